// Statistics of a station's work (docs/statistics.md): control charts of check units, gage R&R,
// capability, yields. Pure functions of numbers; what reads the store is in station_records.h.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "base/time.h"
#include "station/verdict.h"

namespace sixpoint::station {

// --- individuals and moving range chart ---

// Nelson, J. Quality Technology 16 (1984) 237: 1 one point beyond 3 sigma; 2 nine in a row on one
// side; 3 six in a row rising or falling; 4 fourteen alternating; 5 two of three beyond 2 sigma on
// one side; 6 four of five beyond 1 sigma on one side; 7 fifteen within 1 sigma; 8 eight in a row
// beyond 1 sigma on either side. Western Electric's four (1956) are 1, 5, 6 and, with eight in a
// row, 2.
inline constexpr int kNelsonRules = 8;
std::string_view nelson_rule(int rule);  // 1 .. 8

struct ChartSignal {
  std::size_t point = 0;  // the last of those that make it
  int rule = 0;           // 1 .. 8
};

struct ControlChart {
  std::string name;
  std::vector<double> values;
  std::vector<double> moving_ranges;  // one fewer
  std::size_t baseline = 0;           // points that the limits come from; 0: too few yet
  double centre = 0;
  double sigma = 0;  // mean moving range / d2 (1.128 for two points), or the least sigma
  double lower = 0;  // centre -+ 3 sigma
  double upper = 0;
  double mean_range = 0;
  double upper_range = 0;            // D4 (3.267) times the mean range
  std::vector<ChartSignal> signals;  // after the baseline only

  nlohmann::ordered_json to_json() const;
};
// Limits from the first `baseline` values. `from`: signals need all their points at or after this
// index (what an engineer has signed is not held against the station again).
ControlChart control_chart(std::string name, std::vector<double> values, std::size_t baseline,
                           double least_sigma = 0, std::size_t from = 0);

// --- gage R&R ---

struct GageReading {
  std::string part;
  std::string operator_name;
  double value = 0;
};

struct AnovaRow {
  std::string source;
  double degrees_of_freedom = 0;
  double sum_of_squares = 0;
  double mean_square = 0;
  std::optional<double> f;
  std::optional<double> p;
};

struct GageOptions {
  // The interaction is pooled into repeatability above this: where it is plainly chance. Both the
  // textbook's 0.05 and this pool the AIAG example (p = 0.97).
  double pool_above_p = 0.25;
  std::optional<double> tolerance;  // width of the specification, for %GRR of tolerance
  double study_factor = 6;          // study variation in standard deviations
};

struct GageReport {
  int parts = 0;
  int operators = 0;
  int trials = 0;
  std::vector<AnovaRow> anova;         // with the interaction
  std::vector<AnovaRow> anova_pooled;  // as used, where it was pooled; else empty
  bool pooled = false;
  // Variances; what came out negative is 0.
  double repeatability = 0;
  double reproducibility = 0;
  double operator_variance = 0;
  double interaction = 0;
  double part_variance = 0;
  double grr() const { return repeatability + reproducibility; }
  double total() const { return grr() + part_variance; }
  double grr_percent = 0;  // of total variation, as standard deviations
  std::optional<double> grr_percent_of_tolerance;
  int ndc = 0;  // distinct categories
  // AIAG: under 10 % good, to 30 % by application, above that not.
  std::string_view judgement() const;
  bool usable() const { return grr_percent <= 30 && ndc >= 5; }
  std::string brief() const;
  nlohmann::ordered_json to_json() const;
};
// Crossed and balanced: every operator measures every part the same number of times, at least
// twice; at least two of each. bad_data otherwise, naming what is missing.
Result<GageReport> gage_rr(const std::vector<GageReading>& readings,
                           const GageOptions& options = {});
// Columns part, operator, value (in any order, a header names them), comma separated.
Result<std::vector<GageReading>> parse_gage_csv(std::string_view csv, const std::string& where);

// --- capability ---

struct Capability {
  std::size_t n = 0;
  double mean = 0;
  double sd = 0;
  std::optional<double> cp;  // with two limits
  std::optional<double> cp_low, cp_high;
  double cpk = 0;
  double cpk_low = 0;  // of the interval
  double cpk_high = 0;
  double confidence = 0.95;
  nlohmann::ordered_json to_json() const;
};
// Cp's interval by chi-square (exact for normal data), Cpk's by Bissell (Applied Statistics 39
// (1990) 331). Nothing with fewer than two values, without scatter, or without limits.
std::optional<Capability> capability(const std::vector<double>& values, std::optional<double> low,
                                     std::optional<double> high, double confidence = 0.95);

// --- yields ---

// A run as statistics see it, from a db::RunRecord.
struct RunSummary {
  std::string id;
  std::string serial;
  std::string station;
  std::string jig;
  std::string operator_name;
  std::string firmware;
  UtcTime started{};
  double seconds = 0;
  JigVerdict verdict = JigVerdict::inconclusive;
  std::vector<std::string> codes;
  std::vector<JudgedQuantity> quantities;
};

struct Proportion {
  std::size_t count = 0;
  std::size_t of = 0;
  double value() const;  // NaN of none
  double low = 0;        // 95 % interval (Wilson)
  double high = 1;
};
Proportion proportion(std::size_t count, std::size_t of, double confidence = 0.95);

struct GroupStatistics {
  std::string name;  // of the station, jig ...; "all"
  std::size_t runs = 0;
  std::size_t units = 0;
  Proportion yield;             // units whose last judged run passed
  Proportion first_pass_yield;  // units whose first judged run passed
  std::map<std::string, std::size_t> verdicts;
  // Codes of runs that did not pass, most frequent first.
  std::vector<std::pair<std::string, std::size_t>> failure_codes;
  double seconds_per_unit_median = 0;  // all runs of a unit together
  double seconds_per_unit_mean = 0;
};

struct StatisticsReport {
  std::string by;  // "station", "jig", "operator", "firmware"; empty: one group
  GroupStatistics all;
  std::vector<GroupStatistics> groups;
  // Of the last run of every unit: one per quantity and axis.
  std::vector<std::pair<std::string, Capability>> capabilities;

  std::string brief() const;
  nlohmann::ordered_json to_json() const;
};
// usage for an unknown `by`. `runs`: oldest first.
Result<StatisticsReport> statistics(const std::vector<RunSummary>& runs, const std::string& by);

}  // namespace sixpoint::station
