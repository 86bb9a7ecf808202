#include "station/statistics/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/counted.h"
#include "station/statistics/distributions.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// Below this relative standard deviation the scatter is that of the arithmetic.
constexpr double kLeastRelativeSd = 1e-12;

Json or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double median_of(std::vector<double> values) {
  if (values.empty()) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
}

}  // namespace

// --- capability ---

std::optional<Capability> capability(const std::vector<double>& values, std::optional<double> low,
                                     std::optional<double> high, double confidence) {
  if (values.size() < kLeastForCapability || (!low && !high)) {
    return std::nullopt;
  }
  Capability out;
  out.n = values.size();
  out.confidence = confidence;
  const auto n = static_cast<double>(out.n);
  out.mean = mean_of(values);
  double square = 0;
  for (const double value : values) {
    square += (value - out.mean) * (value - out.mean);
  }
  out.sd = std::sqrt(square / (n - 1));
  if (!(out.sd > kLeastRelativeSd * std::abs(out.mean)) || !std::isfinite(out.sd)) {
    return std::nullopt;
  }
  const double tail = (1 - confidence) / 2;
  if (low && high) {
    out.cp = (*high - *low) / (6 * out.sd);
    out.cp_low = *out.cp * std::sqrt(chi_square_quantile(tail, n - 1) / (n - 1));
    out.cp_high = *out.cp * std::sqrt(chi_square_quantile(1 - tail, n - 1) / (n - 1));
  }
  out.cpk = std::min(high ? (*high - out.mean) / (3 * out.sd) : HUGE_VAL,
                     low ? (out.mean - *low) / (3 * out.sd) : HUGE_VAL);
  const double half =
      normal_quantile(1 - tail) * std::sqrt(1 / (9 * n) + out.cpk * out.cpk / (2 * (n - 1)));
  out.cpk_low = out.cpk - half;
  out.cpk_high = out.cpk + half;
  return out;
}

Json Capability::to_json() const {
  return {{"n", n},
          {"mean", mean},
          {"sd", sd},
          {"cp", or_null(cp)},
          {"cp_interval", cp ? Json{*cp_low, *cp_high} : Json(nullptr)},
          {"cpk", cpk},
          {"cpk_interval", {cpk_low, cpk_high}},
          {"confidence", confidence}};
}

// --- yields ---

double Proportion::value() const {
  return of == 0 ? std::numeric_limits<double>::quiet_NaN()
                 : static_cast<double>(count) / static_cast<double>(of);
}

Proportion proportion(std::size_t count, std::size_t of, double confidence) {
  Proportion out;
  out.count = count;
  out.of = of;
  if (of > 0) {
    const double z = normal_quantile(1 - (1 - confidence) / 2);
    const auto n = static_cast<double>(of);
    const double p = static_cast<double>(count) / n;
    const double centre = (p + z * z / (2 * n)) / (1 + z * z / n);
    const double half = z * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n);
    out.low = count == 0 ? 0 : std::max(0.0, centre - half);
    out.high = count == of ? 1 : std::min(1.0, centre + half);
  }
  return out;
}

namespace {

bool is_judged(JigVerdict verdict) {
  return verdict != JigVerdict::stopped && verdict != JigVerdict::inconclusive;
}

GroupStatistics group_of(std::string name, const std::vector<const RunSummary*>& runs) {
  struct Unit {
    std::optional<bool> first_passed;
    bool last_passed = false;
    double seconds = 0;
  };
  GroupStatistics group;
  group.name = std::move(name);
  group.runs = runs.size();
  std::map<std::string, Unit> units;
  std::map<std::string, std::size_t> codes;
  for (const RunSummary* run : runs) {
    Unit& unit = units[run->serial];
    unit.seconds += run->seconds;
    if (is_judged(run->verdict)) {
      unit.last_passed = is_passed(run->verdict);
      if (!unit.first_passed) {
        unit.first_passed = unit.last_passed;
      }
    }
    ++group.verdicts[std::string(to_string(run->verdict))];
    if (!is_passed(run->verdict)) {
      for (const std::string& code : run->codes) {
        ++codes[code];
      }
    }
  }
  group.units = units.size();
  std::size_t judged = 0;
  std::size_t passed = 0;
  std::size_t passed_first = 0;
  std::vector<double> seconds;
  for (const auto& [serial, unit] : units) {
    seconds.push_back(unit.seconds);
    if (unit.first_passed) {
      ++judged;
      passed += unit.last_passed ? 1 : 0;
      passed_first += *unit.first_passed ? 1 : 0;
    }
  }
  group.yield = proportion(passed, judged);
  group.first_pass_yield = proportion(passed_first, judged);
  group.failure_codes.assign(codes.begin(), codes.end());
  std::stable_sort(group.failure_codes.begin(), group.failure_codes.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  group.seconds_per_unit_median = median_of(seconds);
  group.seconds_per_unit_mean = mean_of(seconds);
  return group;
}

Json json_of(const Proportion& proportion) {
  return {{"count", proportion.count},
          {"of", proportion.of},
          {"value", proportion.value()},
          {"interval", {proportion.low, proportion.high}}};
}

Json json_of(const GroupStatistics& group) {
  Json json;
  json["name"] = group.name;
  json["runs"] = group.runs;
  json["units"] = group.units;
  json["yield"] = json_of(group.yield);
  json["first_pass_yield"] = json_of(group.first_pass_yield);
  json["verdicts"] = group.verdicts;
  json["failure_codes"] = Json::array();
  for (const auto& [code, count] : group.failure_codes) {
    json["failure_codes"].push_back({{"code", code}, {"runs", count}});
  }
  json["seconds_per_unit"] = {{"median", group.seconds_per_unit_median},
                              {"mean", group.seconds_per_unit_mean}};
  return json;
}

// Of every unit its last complete run: repeated runs of one unit say nothing about the other units.
void add_capabilities(const std::vector<RunSummary>& runs, const Limits* limits,
                      StatisticsReport& report) {
  std::map<std::string, const RunSummary*> last;
  for (const RunSummary& run : runs) {
    if (!run.quantities.empty()) {
      last[run.serial] = &run;
    }
  }
  struct Series {
    std::string name;
    std::vector<double> values;
    std::optional<double> low, high;
    bool limits_differ = false;
  };
  std::vector<Series> all;  // in the order of the first report
  for (const auto& [serial, run] : last) {
    for (const JudgedQuantity& quantity : run->quantities) {
      const std::string name =
          quantity.axis.empty() ? quantity.name : quantity.name + " " + quantity.axis;
      auto one = std::find_if(all.begin(), all.end(),
                              [&](const Series& series) { return series.name == name; });
      const auto low = limits == nullptr ? quantity.low : limits->of(quantity.name).low;
      const auto high = limits == nullptr ? quantity.high : limits->of(quantity.name).high;
      if (one == all.end()) {
        one = all.insert(one, {name, {}, low, high});
      }
      if (std::isfinite(quantity.value)) {
        one->values.push_back(quantity.value);
      }
      one->limits_differ = one->limits_differ || one->low != low || one->high != high;
    }
  }
  for (const Series& one : all) {
    if (one.limits_differ) {
      report.limits_differ.push_back(one.name);
    } else if (const auto found = capability(one.values, one.low, one.high)) {
      report.capabilities.emplace_back(one.name, *found);
    }
  }
}

}  // namespace

Result<StatisticsReport> statistics(const std::vector<RunSummary>& runs, const std::string& by,
                                    const Limits* limits) {
  const auto key_of = [&](const RunSummary& run) -> const std::string& {
    return by == "station"    ? run.station
           : by == "jig"      ? run.jig
           : by == "operator" ? run.operator_name
                              : run.firmware;
  };
  if (!by.empty() && by != "station" && by != "jig" && by != "operator" && by != "firmware") {
    return fail(ErrorCode::usage, fmt::format("no statistics by '{}'", printable(by, 40)), {},
                "there are: station, jig, operator, firmware");
  }
  StatisticsReport report;
  report.by = by;
  std::vector<const RunSummary*> all;
  std::map<std::string, std::vector<const RunSummary*>> groups;
  for (const RunSummary& run : runs) {
    all.push_back(&run);
    if (!by.empty()) {
      groups[key_of(run)].push_back(&run);
    }
  }
  report.all = group_of("all", all);
  for (const auto& [name, members] : groups) {
    report.groups.push_back(group_of(name, members));
  }
  add_capabilities(runs, limits, report);
  return report;
}

std::string StatisticsReport::brief() const {
  const auto percent = [](const Proportion& part) {
    return part.of == 0
               ? std::string("-")
               : fmt::format("{:.1f} % ({} of {})", 100 * part.value(), part.count, part.of);
  };
  return fmt::format("{} of {}; yield {}, first pass {}", counted(all.runs, "run"),
                     counted(all.units, "unit"), percent(all.yield), percent(all.first_pass_yield));
}

Json StatisticsReport::to_json() const {
  Json json;
  json["by"] = by;
  json["all"] = json_of(all);
  json["groups"] = Json::array();
  for (const GroupStatistics& group : groups) {
    json["groups"].push_back(json_of(group));
  }
  json["capability"] = Json::object();
  for (const auto& [name, one] : capabilities) {
    json["capability"][name] = one.to_json();
  }
  json["limits_differ"] = limits_differ;
  return json;
}

}  // namespace sixpoint::station
