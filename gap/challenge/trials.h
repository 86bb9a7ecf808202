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
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "sim/scenario.h"
#include "sim/standard_protocol.h"

namespace sixpoint::gap {

enum class TrialKind { none, single, pair, outside };
std::string_view to_string(TrialKind kind);

struct TrialEffect {
  std::string name;
  double severity = 1;
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
};

// The same seed and index give the same trial. `only` restricts the effects drawn, of the catalogue
// or outside it; empty: all that the protocol can show.
Result<GapTrial> draw_trial(std::uint64_t seed, std::uint64_t index, sim::StandardProtocol protocol,
                            const TrialShares& shares, const std::vector<std::string>& only = {});

// Effects that one recording rarely tells apart answer to one family name.
std::string_view family_of(std::string_view effect);

}  // namespace sixpoint::gap
