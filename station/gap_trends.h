// Whose it is: what many jig runs have in common belongs to the jig or the station, not the unit.
//
// A unit on one face of a level jig reads nothing across. What it does read there, twelve numbers a
// run (two axes on each of six faces), is the unit's own skew, new with each unit and as often one
// way as the other, plus what the jig does to every unit alike. Under the hypothesis that a jig
// does nothing, flipping the signs of single units' patterns changes nothing: the length of the
// mean pattern against that of flipped ones gives the chance of it, without any assumption about
// the units' scatter (a randomisation test; Good, "Permutation, Parametric and Bootstrap Tests of
// Hypotheses", 2005).
#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/result.h"
#include "station/jig_bundle.h"

namespace sixpoint::station {

// Degrees that each face reads across, faces in the order of device::kPoses, two axes each.
using SkewPattern = std::array<double, 12>;
// bad_data where the report holds no six faces.
Result<SkewPattern> skew_of_run(const StoredRun& run);

enum class Owner { nobody, unit, jig, station, too_few };
std::string_view to_string(Owner owner);

struct JigTrend {
  std::string jig;
  std::size_t units = 0;
  std::size_t runs = 0;
  double common_deg = 0;  // rms of the pattern that all its units share
  double units_deg = 0;   // rms of what is each unit's own
  double chance = 1;      // of a common pattern as long as this by the units alone
  SkewPattern pattern_deg{};
  Owner owner = Owner::too_few;
};

struct GapTrends {
  std::vector<JigTrend> jigs;  // most runs first
  std::size_t runs = 0;
  std::size_t left_out = 0;  // runs without six faces
};

struct TrendOptions {
  // Six units give 32 ways to flip: one in 32 is the smallest chance that can come out.
  std::size_t fewest_units = 6;
  double alarm_chance = 0.04;
  double least_deg = 0.02;  // twice a good seat's scatter: less is nobody's business
  std::size_t flips = 4000;
};

GapTrends find_trends(const std::vector<StoredRun>& runs, const TrendOptions& options = {});

}  // namespace sixpoint::station
