// Yields and capability of a station's work (docs/statistics.md).
//
//   SIXPOINT_ASSIGN(const StatisticsReport report, statistics(runs, "operator"));
//   std::cout << report.brief() << '\n' << report.to_json();
//
// Pure functions. station_records.h reads the runs from the store; control charts are in
// control_chart.h, gage R&R in gage_rr.h. Numbers that are not finite become null in JSON.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "base/time.h"
#include "station/limits/verdict.h"
#include "station/statistics/control_chart.h"
#include "station/statistics/gage_rr.h"

namespace sixpoint::station {

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
// Of fewer values the interval of a Cpk is about as wide as the Cpk itself, on both sides.
inline constexpr std::size_t kLeastForCapability = 5;
// Cp's interval by chi-square (exact for normal data), Cpk's by Bissell (Applied Statistics 39
// (1990) 331).
//
// | values          | scatter          | limits | capability |
// |-----------------|------------------|--------|------------|
// | fewer than five | any              | any    | none       |
// | five and more   | none             | any    | none       |
// | five and more   | some             | none   | none       |
// | five and more   | some             | one    | Cpk        |
// | five and more   | some             | both   | Cp and Cpk |
std::optional<Capability> capability(const std::vector<double>& values, std::optional<double> low,
                                     std::optional<double> high, double confidence = 0.95);

// --- yields ---

// What the statistics need of a run; summary_of() in station_records.h makes it.
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
  // Of the last complete run of every unit: one per quantity and axis.
  std::vector<std::pair<std::string, Capability>> capabilities;
  std::vector<std::string> limits_differ;  // quantities that have no capability for that reason

  std::string brief() const;
  nlohmann::ordered_json to_json() const;
};
// usage for an unknown `by`. `runs`: oldest first. A quantity's capability goes by these limits:
//
// | `limits` | its runs were judged by | capability                                |
// |----------|-------------------------|-------------------------------------------|
// | given    | any                     | by the given ones                         |
// | none     | the same low and high   | by these                                  |
// | none     | different ones          | none; the quantity is in `limits_differ`  |
Result<StatisticsReport> statistics(const std::vector<RunSummary>& runs, const std::string& by,
                                    const Limits* limits = nullptr);

}  // namespace sixpoint::station
