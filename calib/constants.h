// Constants: what turns a unit's raw counts into g, under which filter they hold, and their file.
//
//   const StoredConstants stored{{264, 262, 259}, {-254, -257, -251}, {5, 3, 4}};
//   SIXPOINT_ASSIGN(const Calibration constants, calibration_from(stored));
//   const double value_g = constants.to_g(0, 132);  // axis X, a raw count of the sensor
//
// Constants belong to (serial number, filter configuration): the same sensor reads differently
// under the two antialiasing configurations, and constants measured under one and applied under the
// other are the defect that this program repairs.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "base/measure.h"
#include "base/result.h"
#include "base/stored_constants.h"
#include "base/time.h"

namespace sixpoint::calib {

// What the firmware set the sensor's antialiasing filter to: `legacy` on units calibrated before
// 2014-03-24 and run by firmware below 1.4.0 or from 1.8.0 on, `current` on everything else.
enum class FilterConfiguration { legacy, current };
std::string_view to_string(FilterConfiguration filter);
Result<FilterConfiguration> parse_filter_configuration(std::string_view text);  // usage if unknown

// The six degrees of freedom of the paper's nine coefficients: Eq. 1-3 use `positive` and
// `negative` only through their difference. In raw counts of the sensor, not rounded.
struct Calibration {
  PerAxis<double> sensitivity_g_per_lsb{};
  PerAxis<double> zero_lsb{};

  // Paper, Eq. 4-6.
  double to_g(std::size_t axis, double raw_lsb) const {
    return sensitivity_g_per_lsb[axis] * (raw_lsb - zero_lsb[axis]);
  }
  PerAxis<double> to_g(const PerAxis<double>& raw_lsb) const {
    return {to_g(0, raw_lsb[0]), to_g(1, raw_lsb[1]), to_g(2, raw_lsb[2])};
  }
  bool operator==(const Calibration&) const = default;
};

// bad_data, naming the axis, when a constant is outside [-2048, 2047] or positive is not above
// negative (Eq. 1-3 would divide by zero or turn the axis over).
Status validate(const StoredConstants& stored);
// bad_data when a number is not finite, a sensitivity is not positive, or either is beyond what any
// 16-bit sensor can have (sensitivity within 1/32768 .. 1 g per LSB, zero within +-32768 LSB).
Status validate(const Calibration& calibration);

// Why no working ADXL362, the sensor of the units that 16CPAN03 affects, has these constants: one
// sentence that names the axis; empty where it can. 150 to 350 LSB/g, and a zero within 0.75 g. The
// datasheet has 250 LSB/g in the range of 8 g; the real recordings in ../shared/data have 223 to
// 278 LSB/g and zeros up to 0.35 g, and the filter configuration moves both. The bounds are wide on
// purpose: they find what was mistyped or is in other units of measure, not what is a little wrong.
std::string why_no_sensor(const Calibration& calibration);

// Eq. 1-3. Fails as validate() does.
Result<Calibration> calibration_from(const StoredConstants& stored);

// The nine integers nearest to a calibration, each rounded by itself: zero, the difference
// positive - negative (which is what Eq. 1-3 use), and the pair placed about zero. One count of
// zero is 3.9 mg, so solvers search the neighbours (round_constants in solve.h) instead.
// bad_data when they do not fit into [-2048, 2047].
Result<StoredConstants> nearest_stored(const Calibration& calibration);

// Standard (one sigma) uncertainty of a calibration.
struct ConstantsUncertainty {
  PerAxis<double> sensitivity_relative{};
  PerAxis<double> zero_mg{};
};

// Constants with cross-axis terms: g = (I + C) u, where u is Eq. 4-6 by `calibration` and C is
// symmetric with zeros on its diagonal. It is whole by itself: the six in it are the sensor's own,
// which need not be the six of the record (best_six.h). Six constants cannot correct what C does.
struct CrossAxisMap {
  Calibration calibration;
  PerAxis<double> cross_axis{};  // xy, xz, yz: fractions
  ConstantsUncertainty uncertainty;
  PerAxis<double> cross_axis_sd{};  // standard uncertainties
  // The evidence: root mean square error in directions that the fits had not seen, over the time at
  // rest, with this map and with the record's six constants.
  int unseen_directions = 0;
  double unseen_mg = 0;
  double six_unseen_mg = 0;
  bool verified = false;

  PerAxis<double> to_g(const PerAxis<double>& raw_lsb) const {
    const PerAxis<double> u = calibration.to_g(raw_lsb);
    const auto& [xy, xz, yz] = cross_axis;
    return {u[0] + xy * u[1] + xz * u[2], u[1] + xy * u[0] + yz * u[2],
            u[2] + xz * u[0] + yz * u[1]};
  }
};

// bad_data when a number is not finite, or a term is beyond what any working sensor has (0.2).
Status validate(const CrossAxisMap& map);

// Where constants came from. `kind`: "jig", "calibration_file" (the unit at rest on its sides) or
// "file_scan" (a file that was worn); empty where it is not known. `sha256` is that of the
// recording or session; empty when there is none (constants typed in).
struct ConstantsOrigin {
  std::string sha256;
  std::string file;     // name of the recording, for people
  std::string station;  // who measured, for people
  std::string kind = {};
};

// One set of constants with everything needed to trust it: the content of constants.json and a row
// of the store.
struct ConstantsRecord {
  std::string serial;
  FilterConfiguration filter = FilterConfiguration::current;
  Calibration calibration;  // these hold; `stored` is what fits into a unit's memory
  StoredConstants stored;
  ConstantsUncertainty uncertainty;
  std::string method;  // "least_squares", "genetic", "six_pose", ...
  UtcTime made_at{};
  ConstantsOrigin made_from;
  double gravity_m_per_s2 = kStandardGravity_m_per_s2;
  // The constants rest on a population prior (solve --prior population) and not on this unit's data
  // alone. `repair` refuses them unless asked for by name.
  bool from_prior = false;
  // Present where the data show cross-axis terms. Which of the two a file gets: map_to_apply.h.
  std::optional<CrossAxisMap> cross_axis;

  std::string brief() const;  // one line for people
};

// A real sensor against its stored constants: its zero lies within 0.5 g, its sensitivity within
// 10 % of nominal (paper; ADXL362 datasheet), and the filter mismatch adds to that.
inline constexpr double kLeastGain = 0.72;
inline constexpr double kMostGain = 1.38;
inline constexpr double kMostZeroChange_g = 0.5;

// null for a number that is absent or not finite.
nlohmann::ordered_json number_or_null(const std::optional<double>& value);
nlohmann::ordered_json to_json(const StoredConstants& stored);  // {positive_lsb, ...}
nlohmann::ordered_json to_json(const Calibration& calibration);
nlohmann::ordered_json to_json(const Calibration& calibration, const StoredConstants& stored);
nlohmann::ordered_json to_json(const ConstantsUncertainty& uncertainty);
nlohmann::ordered_json to_json(const CrossAxisMap& map);
nlohmann::ordered_json to_json(const ConstantsRecord& record);

// Reads constants.json. Strict where a wrong value would make data worse: serial, filter and
// constants must be there and valid. `constants` may hold the doubles, the nine integers, or both
// (then the doubles hold). What is only for people may be missing.
Result<ConstantsRecord> constants_record_from_json(const nlohmann::ordered_json& json);
Result<ConstantsRecord> parse_constants_record(std::string_view text);

}  // namespace sixpoint::calib
