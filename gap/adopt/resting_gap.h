// How far a resting sensor's lengths are from gravity, for a simulator with given effects on: the
// gap of a table of readings, which has no protocol (gap/unguided/readings_table.h).
//
//   SIXPOINT_ASSIGN(const ReadingsTable table, read_readings_table(files, "free_living.csv"));
//   SIXPOINT_ASSIGN(const RestingGap nominal, resting_gap(table.rests, {}));
//   SIXPOINT_ASSIGN(const RestingGap learnt,
//                   resting_gap(table.rests, sim::mean_effects(population)));
//
// Each reading's direction is put through the simulator's sensor with the effects on; what they do
// to it is taken off the reading, gain and zero of each axis are fitted, and the gap is the root
// mean square of the lengths' errors. A rotation changes no length: misalignment and tilt show
// nothing here, and effects of time and temperature are not simulated.
#pragma once

#include <cstddef>
#include <vector>

#include "gap/unguided/readings_table.h"
#include "sim/effects/effect.h"

namespace sixpoint::gap {

struct RestingGap {
  double gap_mg = 0;
  // Rests that count: those off by more than five times the scatter of the others were not at rest.
  // Which ones is decided with no effect on.
  std::size_t rests = 0;
};

// bad_data as fit_lengths().
Result<RestingGap> resting_gap(const std::vector<RestingReading>& rests,
                               const std::vector<sim::EffectSpec>& effects);

}  // namespace sixpoint::gap
