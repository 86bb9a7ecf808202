// Skew that many jig runs have in common: does it belong to the units, the jig or the station?
//
//   SIXPOINT_ASSIGN(const auto runs, stored_jig_runs(store));
//   for (const JigTrend& trend : find_trends(runs).jigs) {
//     std::cout << trend.jig << ": " << to_string(trend.cause) << '\n';
//   }
//
// A unit on one face of a level jig shows no gravity on the two other axes. The twelve readings of
// a run there (two axes on each of six faces) hold the unit's own skew, which differs from unit to
// unit in both directions, and the tilt that the jig gives to every unit. If the jig has no tilt,
// the patterns of single units may change their signs and nothing else changes. So the length of
// the mean pattern, compared with that of patterns with random signs, gives the probability that
// the units alone make it. No assumption about the units' scatter is needed (a randomisation test;
// Good, "Permutation, Parametric and Bootstrap Tests of Hypotheses", 2005).
#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/result.h"
#include "station/records/jig_bundle.h"

namespace sixpoint::station {

// Degrees on the two other axes of each face, faces in the order of device::kPoses.
using SkewPattern = std::array<double, 12>;
// bad_data where the report holds no six faces.
Result<SkewPattern> skew_of_run(const StoredRun& run);

enum class TrendCause { none, unit, jig, station, too_few_units };
std::string_view to_string(TrendCause cause);  // "none" for none

struct JigTrend {
  std::string jig;
  std::size_t units = 0;
  std::size_t runs = 0;
  double common_deg = 0;  // rms of the pattern that all its units share
  double units_deg = 0;   // rms of the units' own skew
  double chance = 1;      // probability that the units alone have a common pattern of this length
  SkewPattern pattern_deg{};
  TrendCause cause = TrendCause::too_few_units;
};

struct GapTrends {
  std::vector<JigTrend> jigs;  // most runs first
  std::size_t runs = 0;
  std::size_t left_out = 0;  // runs without six faces
};

struct TrendOptions {
  // Six units have 32 different sign patterns: the smallest possible chance is 1/32.
  std::size_t fewest_units = 6;
  double alarm_chance = 0.04;
  double least_deg = 0.02;  // twice the scatter of a good seat: a smaller skew does not matter
  std::size_t sign_patterns = 4000;  // random ones that are compared
};

GapTrends find_trends(const std::vector<StoredRun>& runs, const TrendOptions& options = {});

}  // namespace sixpoint::station
