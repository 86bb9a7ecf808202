// What many jig runs have in common: does a reading belong to the unit, the jig, one of its faces,
// the station, or the production lot?
//
//   SIXPOINT_ASSIGN(const auto runs, stored_jig_runs(store));
//   for (const JigTrend& trend : find_trends(runs).jigs) {
//     std::cout << trend.jig << ": " << to_string(trend.cause) << '\n';
//   }
//
// The model is that of shared_effects.h: units, jigs, faces, stations and lots beside each other,
// so that a jig with three units is judged by what all units of the store scatter. Beside its
// probability each jig with six units has a check that assumes nothing about the units' scatter:
// if the jig has no tilt and no lot has a skew, the patterns of single units may change their signs
// and nothing else changes. So the length of the mean pattern, compared with that of patterns with
// random signs, gives the chance that the units alone make it (a randomisation test; Good,
// "Permutation, Parametric and Bootstrap Tests of Hypotheses", 2005).
//
// Several runs of a unit share its own value. A unit whose zero or sensitivity moved between two of
// its runs, by more than runs scatter and the temperature explains, is told with the run from which
// on.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "base/result.h"
#include "device/jig.h"
#include "station/records/jig_bundle.h"
#include "station/records/run_readings.h"
#include "station/records/shared_effects.h"

namespace sixpoint::station {

enum class TrendCause { none, unit, jig, face, jig_or_lot, station, too_few_units };
std::string_view to_string(TrendCause cause);  // "none" for none

struct TrendOptions {
  std::size_t fewest_units = 3;           // on a jig or a station, or of a lot, that is judged
  std::size_t fewest_units_in_store = 6;  // that teach what units scatter
  double named_probability = 0.95;
  double least_deg = 0.02;   // twice the scatter of a good seat: a smaller skew does not matter
  double least_zero_mg = 2;  // half of the 4 mg that a repair may leave
  double least_sensitivity_percent = 0.2;  // the same at 1 g
  // The sign-flip check needs six: they have 32 different patterns of signs.
  std::size_t fewest_units_of_check = 6;
  std::size_t sign_patterns = 4000;  // random ones that are compared
  // A change of a unit, or a face that does not repeat: after correction for the number of tests.
  double alarm_chance = 0.001;
  // A run is set aside where opposite faces lean alike by so much more than the median of its jig's
  // runs (three at least): a unit that was not seated. Good seats repeat to 0.01 degree.
  double badly_seated_deg = 0.5;
  // Data sheet of the ADXL362, typical. What it explains is no change of the unit.
  double zero_mg_per_c = 0.6;
  double sensitivity_percent_per_c = 0.05;
  SharedEffectOptions effects;
};

// What is known about a jig when its cause is named. `jig`, `tilt`, `face`, `station`: it is
// probable and large enough (is_named()).
struct CauseEvidence {
  std::size_t units = 0;           // on the jig
  std::size_t units_in_store = 0;  // of all jigs
  bool jig = false;                // the jig does something: a tilt, or a face of it, or both
  bool tilt = false;
  bool face = false;
  bool face_scatters = false;  // it does not repeat
  bool lot_explains = false;   // a lot that is named for it, or would be in its place
  bool station = false;
  double units_deg = 0;  // the units' own skew
};
// The first row that holds:
//
//     what is known                                              cause
//     too few units on the jig, or in the store                  too_few_units
//     the jig does something, or a lot instead of it             jig_or_lot
//     it does, and it is a face and no tilt                      face
//     it does; a tilt, or a tilt or a face                       jig
//     one of its faces does not repeat                           face
//     its station moves all its jigs                             station
//     the units have a skew of their own, of least_deg           unit
//     nothing                                                    none
TrendCause which_cause(const CauseEvidence& evidence, const TrendOptions& options);
// Probable (named_probability), and of `least` or more.
bool is_named(double probability, double size, double least, const TrendOptions& options);

struct FaceTrend {
  device::Pose face = device::Pose::plus_z;
  double probability = 0;  // that it leans otherwise than the jig
  double size_deg = 0;     // by so much, where it does
  double standard_uncertainty_deg = 0;
  double scatter_deg = 0;     // of placements on it within a run; 0 where nothing was placed twice
  double scatter_chance = 1;  // that it repeats as the others do
  bool is_off = false;        // named
  bool does_not_repeat = false;
};

struct JigTrend {
  std::string jig;
  std::size_t units = 0;
  std::size_t runs = 0;
  double common_deg = 0;  // rms of the pattern that all its units share
  double units_deg = 0;   // rms of the units' own skew
  double chance = 1;      // probability that the units alone have a common pattern of this length
  bool has_chance = false;
  SkewPattern pattern_deg{};
  TrendCause cause = TrendCause::too_few_units;
  // By the model: the tilt of the jig alone, a root mean square over its faces.
  double probability = 0;       // that the jig does anything
  double tilt_probability = 0;  // ... that it tilts
  double tilt_deg = 0;
  double standard_uncertainty_deg = 0;
  SkewPattern tilt_pattern_deg{};
  std::array<FaceTrend, 6> faces{};              // in the order of device::kPoses
  std::vector<std::string> not_told_apart_from;  // "lot A", "station B"
};

// Of a station or a lot.
struct SharedTrend {
  double probability = 0;
  double size = 0;  // degrees of tilt, mg, or percent (the largest axis)
  double standard_uncertainty = 0;
  std::size_t axis = 0;       // of zero and sensitivity
  std::vector<double> value;  // twelve, or three
  bool is_named = false;
  std::vector<std::string> not_told_apart_from;
};
struct GroupTrend {
  std::string name;
  std::size_t units = 0;
  std::size_t runs = 0;
  std::size_t jigs = 0;
  SharedTrend skew, zero, sensitivity;
  bool is_named() const { return skew.is_named || zero.is_named || sensitivity.is_named; }
};

struct UnitChange {
  std::string serial;
  std::string filter;
  std::string run;       // the first run after the change
  std::string quantity;  // "zero" (mg) or "sensitivity" (percent)
  std::size_t axis = 0;
  double size = 0;
  double standard_uncertainty = 0;
  double chance = 1;  // of such a change somewhere in this store by scatter alone
  std::size_t runs_before = 0;
  std::size_t runs_after = 0;
};

// A run that the model does not use, since a face was badly seated.
struct BadlySeated {
  std::string run;
  std::string serial;
  std::string jig;
  std::size_t axis = 0;  // of the two opposite faces
  double lean_deg = 0;   // of their mean
};

struct GapTrends {
  std::vector<JigTrend> jigs;        // most runs first
  std::vector<GroupTrend> stations;  // by name
  std::vector<GroupTrend> lots;      // by name; empty where no lots are known
  std::vector<UnitChange> unit_changes;
  std::size_t runs = 0;
  std::vector<BadlySeated> badly_seated;
  std::size_t left_out = 0;  // runs without six faces, or with values that no unit has
  std::size_t units = 0;
  std::size_t units_without_lot = 0;
  // Standard deviations of one component: units' own values, and placements or runs.
  CrossedScatter turn_deg, shear_deg, even_deg, zero_mg, sensitivity_percent;
  // Learnt from the store: the share of jigs, stations and lots that have a skew in common.
  std::array<double, 3> share{};
};

// Lots by serial number: where it is empty, no lot is known and the model has none.
using LotOfSerial = std::map<std::string, std::string>;
// A CSV file with the columns `serial` and `lot`. bad_data with the line where it is none, or where
// a serial has two lots.
Result<LotOfSerial> parse_lots(std::string_view csv, const std::string& where);

GapTrends find_trends(const std::vector<StoredRun>& runs, const LotOfSerial& lots = {},
                      const TrendOptions& options = {});

}  // namespace sixpoint::station
