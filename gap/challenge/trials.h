// Trials for the diagnosis of the gap: units with known effects, drawn so that they share only the
// names with what the diagnosis searches for.
//
//   const auto protocol = sim::StandardProtocol::production;
//   SIXPOINT_ASSIGN(const GapTrial trial, draw_trial(seed, 0, protocol, TrialShares{}));
//   trial.effects;   // the truth
//   trial.scenario;  // its simulation is what the diagnosis gets
//
// Severity is log-uniform from 0.3 to 3 times a typical size. Forms vary on purpose: mounts ring in
// two modes, lines have harmonics, drifts bend, low-passes have several orders, warm-ups two time
// constants. Trials outside the catalogue hold effects that no diagnosis knows by name
// (outside.h).
//
// A realistic unit has everything at once: half of them all ten small effects, half four to eight
// effects of the gradual ones. Each is 0.05 to 0.5 times typical, but for one that dominates with 3
// to 6 times; the clock is off by 5 to 40 ppm. The dominant effect comes first in
// GapTrial::effects.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "sim/scenario.h"
#include "sim/standard_protocol.h"

namespace sixpoint::gap {

enum class TrialKind { none, single, pair, outside, realistic };
std::string_view to_string(TrialKind kind);

struct TrialEffect {
  std::string name;
  double severity = 1;
  std::size_t parts = 1;  // of scenario.protocol->effects, in the same order
};

struct GapTrial {
  TrialKind kind = TrialKind::none;
  std::vector<TrialEffect> effects;  // the truth; names outside the catalogue for `outside`
  sim::Scenario scenario;            // with a protocol
};

struct TrialShares {
  double none = 0.15;
  double pair = 0.2;
  double outside = 0.15;  // the rest is single
  double realistic = 0;
  bool any_rate = false;  // sample rates of 20 to 100 Hz instead of 100
  // Singles and pairs of gradual effects only, log-uniform from 0.005 to 0.3 times a typical size:
  // near what a recording shows at all.
  bool faint = false;
};

// The same seed and index give the same trial. `only` restricts the effects drawn, of the catalogue
// or outside it; empty: all that the protocol can show. usage where nothing is left to be drawn.
Result<GapTrial> draw_trial(std::uint64_t seed, std::uint64_t index, sim::StandardProtocol protocol,
                            const TrialShares& shares, const std::vector<std::string>& only = {});

// What a realistic unit is drawn from; every unit has the first ten.
const std::vector<std::string>& gradual_effects();

// Effects that one recording rarely tells apart answer to one family name.
std::string_view family_of(std::string_view effect);

}  // namespace sixpoint::gap
