// The limits that a jig run is judged by: a TOML file, or the built-in defaults (docs/limits.md).
//
//   SIXPOINT_ASSIGN(const Limits limits, read_limits(env.files, "limits.toml"));
//   limits.of("zero_offset_mg").high;  // in mg
//
// One table per quantity, named as in quantities(), with `low`, `high` (at least one where the
// quantity has both) and `guard_band`, all in the quantity's unit; beside them `decision`, `retest`
// and `check_unit`. What the file leaves out keeps its default. The SHA-256 of the file's bytes is
// stored with every run that it judged.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "base/result.h"

namespace sixpoint::station {

// What can be limited. Names, units and meanings are fixed; they are the keys of the TOML file and
// of the JSON of a run.
struct QuantityInfo {
  std::string_view name;      // "zero_offset_mg"
  std::string_view title;     // for people and certificates: "Zero offset"
  std::string_view unit;      // "mg", "%", "\u00b0C", "\u00b0"; empty for a pure number
  std::optional<double> low;  // built-in limits; a quantity without a built-in low has none
  std::optional<double> high;
  double least = 0;  // limits outside least .. most are no limits for this quantity
  double most = 0;
  std::string_view code_low;  // failure codes (verdict.h)
  std::string_view code_high;
  std::string_view reason;  // why the built-in limits are what they are
};
const std::vector<QuantityInfo>& quantities();
const QuantityInfo* find_quantity(std::string_view name);  // nullptr where there is none
// For people, with its axis where it has one: "zero_offset_mg x" is "Zero offset x, mg", as on the
// page. A name that is no quantity's stays as it is.
std::string title_of(std::string_view name_and_axis);

struct Limit {
  std::string name;
  std::optional<double> low;
  std::optional<double> high;
  // The least distance from a limit at which a value still passes, whatever its uncertainty.
  double guard_band = 0;
};

// ILAC-G8:09/2019, 4.2.3: the guard band is `guard_factor` times the expanded uncertainty.
struct DecisionRule {
  double coverage_factor = 2;  // about 95 %
  double guard_factor = 1;     // 1: at most 2.5 % of wrong passes at the limit; 0: shared risk
};

// A unit is not simply tested until it passes.
struct RetestPolicy {
  int most_failures = 3;         // in a row, conditional or not; then an engineer decides
  int passes_after_failure = 2;  // in a row, until the unit counts as passed
};

struct CheckUnitPolicy {
  int baseline_runs = 10;  // runs that the chart's limits are computed from
  // Nelson's rules (statistics.h) that lock the station. All eight, on six charts, would lock a
  // good station every fourth week.
  std::vector<int> locking_rules = {1, 2, 5};
  // Smaller scatter counts as this: seating of 0.01 degree and the noise of a dwell.
  double least_sigma_zero_mg = 0.3;
  double least_sigma_sensitivity_percent = 0.03;
};

struct Limits {
  std::vector<Limit> limits;  // one for every quantity, in the order of quantities()
  DecisionRule decision;
  RetestPolicy retest;
  CheckUnitPolicy check_unit;
  std::string source = "built-in";  // the file's name, for people
  std::string sha256;               // of the file's bytes; of to_toml() for the built-in ones

  const Limit& of(std::string_view name) const;  // a name of quantities()
};

Limits default_limits();
// configuration, with the line in `where` ("limits.toml:12"), for what contradicts itself: a low
// above its high, a guard band that leaves nothing to pass, an unknown key, a value of the wrong
// type, negative where that makes no sense, NaN, infinite, or beyond what the quantity can be; and
// for a file that is no TOML.
Result<Limits> parse_limits(std::string_view toml, const std::string& source);
// At most 1 MiB. An empty path gives the built-in limits.
Result<Limits> read_limits(FileSystem& files, const std::string& path);

// All of it as TOML with its reasons as comments; parse_limits() gives the same limits back.
std::string to_toml(const Limits& limits);
nlohmann::ordered_json to_json(const Limits& limits);

}  // namespace sixpoint::station
