// How far a recording is from a simulator with given effects on, by running its protocol again.
//
//   SIXPOINT_ASSIGN(const RecordedBundle one, recorded_bundle(bundle, {}));
//   SIXPOINT_ASSIGN(const BundleGap nominal, gap_with(one, {}));
//   SIXPOINT_ASSIGN(const BundleGap learnt, gap_with(one, sim::mean_effects(population)));
//   const double closed_mg2 = nominal.gap_mg * nominal.gap_mg - learnt.gap_mg * learnt.gap_mg;
//
// Nothing is added up from claims: the simulator (sim/protocol_run.h) goes through the bundle's own
// segments with the effects and without, and what remains of the recording is measured as the
// diagnosis measures `gap.before` (gap/judge/gap_against.h).
//
// What leaves the means alone (lines, ringing, slips, held values) is compared by size: the
// diagnosis measures it in the recording and in the simulation, and what counts is the difference
// of the two root mean squares. Scatter (seating, random walk, flicker, jitter) can't be predicted
// for a single placement: it closes nothing, and is not simulated here. Where the recording is
// named a filter mismatch, its gain and its offsets count too; the unit's own offset is in them.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "gap/judge/diagnose.h"
#include "gap/recording/bundle.h"
#include "sim/effects/effect.h"

namespace sixpoint::gap {

struct RecordedBundle {
  Bundle bundle;
  DiagnoseOptions how;
  Diagnosis diagnosis;
};
Result<RecordedBundle> recorded_bundle(Bundle bundle, const DiagnoseOptions& how);

struct BundleGap {
  double gap_mg = 0;      // root mean square per axis and mean, of all that follows
  double means_mg = 0;    // of means and small tones
  double by_size_mg = 0;  // of what leaves the means alone
  double floor_mg = 0;    // of noise and seating
};

// Of a placement or a sample by chance: it can't be predicted, and is not simulated here.
bool is_scatter(std::string_view effect);

// bad_data as gap_against(), or where the protocol is none that the simulator can run.
Result<BundleGap> gap_with(const RecordedBundle& recorded,
                           const std::vector<sim::EffectSpec>& effects, std::uint64_t seed = 1);

}  // namespace sixpoint::gap
