// What a jig run measured, as numbers that can be compared between runs, units and jigs.
//
//   SIXPOINT_ASSIGN(const RunReadings readings, readings_of_run(run));
//   std::cout << readings.zero_mg[2] << " mg, " << readings.placements << " of each face\n";
//
// A unit on one face of a level jig shows no gravity on the two other axes. The twelve readings of
// a run there (two axes on each of six faces) are its skew: that of the unit and that of the jig.
// All placements of a face are averaged: the six that gave the constants and those that verified
// them. Zero and sensitivity are those of the two faces of an axis, their middle and half of their
// difference.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "base/measure.h"
#include "base/result.h"
#include "station/records/jig_bundle.h"

namespace sixpoint::station {

// Degrees on the two other axes of each face, faces in the order of device::kPoses, axes in that of
// X Y Z.
using SkewPattern = std::array<double, 12>;

// How the placements of one face differ within a run.
struct FaceRepeats {
  double square_deg2 = 0;  // sum of squared differences from their mean, both axes
  double degrees_of_freedom = 0;
};

struct RunReadings {
  SkewPattern skew_deg{};
  PerAxis<double> zero_mg{};
  PerAxis<double> sensitivity_lsb_per_g{};  // by the report's local gravity, else standard gravity
  std::array<FaceRepeats, 6> repeats{};     // by face, in the order of device::kPoses
  std::size_t placements = 0;               // of the face that has fewest
  std::optional<double> temperature_c;      // mean of all placements
  std::string filter;                       // empty where the report has none
};

// bad_data where the report holds no six faces, or values that no unit on a jig can have: fewer
// than 50 or more than 2000 LSB/g, a skew of more than 10 degrees.
Result<RunReadings> readings_of_run(const StoredRun& run);

}  // namespace sixpoint::station
