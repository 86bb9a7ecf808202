#include "station/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "station/distributions.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }
Json number(const std::optional<double>& value) { return value ? number(*value) : Json(nullptr); }

double mean_of(const std::vector<double>& values, std::size_t count) {
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
    sum += values[i];
  }
  return sum / static_cast<double>(count);
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
  if (values.size() < 2 || (!low && !high)) {
    return std::nullopt;
  }
  Capability out;
  out.n = values.size();
  out.confidence = confidence;
  const auto n = static_cast<double>(out.n);
  out.mean = mean_of(values, values.size());
  double square = 0;
  for (const double value : values) {
    square += (value - out.mean) * (value - out.mean);
  }
  out.sd = std::sqrt(square / (n - 1));
  // Below that it is the arithmetic's scatter and not the units'.
  constexpr double kLeastRelative = 1e-12;
  if (!(out.sd > kLeastRelative * std::abs(out.mean)) || !std::isfinite(out.sd)) {
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
  Json json;
  json["n"] = n;
  json["mean"] = number(mean);
  json["sd"] = number(sd);
  json["cp"] = number(cp);
  json["cp_interval"] = cp ? Json{number(cp_low), number(cp_high)} : Json(nullptr);
  json["cpk"] = number(cpk);
  json["cpk_interval"] = {number(cpk_low), number(cpk_high)};
  json["confidence"] = confidence;
  return json;
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
  group.seconds_per_unit_mean =
      seconds.empty() ? std::numeric_limits<double>::quiet_NaN() : mean_of(seconds, seconds.size());
  return group;
}

Json json_of(const Proportion& proportion) {
  return {{"count", proportion.count},
          {"of", proportion.of},
          {"value", number(proportion.value())},
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
  json["seconds_per_unit"] = {{"median", number(group.seconds_per_unit_median)},
                              {"mean", number(group.seconds_per_unit_mean)}};
  return json;
}

// Of every unit its last complete run: repeats of one unit are no sample of the units.
std::vector<std::pair<std::string, Capability>> capabilities_of(
    const std::vector<RunSummary>& runs) {
  std::map<std::string, const RunSummary*> last;
  for (const RunSummary& run : runs) {
    if (!run.quantities.empty()) {
      last[run.serial] = &run;
    }
  }
  struct Series {
    std::vector<double> values;
    std::optional<double> low, high;
  };
  std::vector<std::string> order;
  std::map<std::string, Series> series;
  for (const auto& [serial, run] : last) {
    for (const JudgedQuantity& quantity : run->quantities) {
      const std::string name =
          quantity.axis.empty() ? quantity.name : quantity.name + " " + quantity.axis;
      if (series.find(name) == series.end()) {
        order.push_back(name);
      }
      Series& one = series[name];
      if (std::isfinite(quantity.value)) {
        one.values.push_back(quantity.value);
      }
      one.low = quantity.low;
      one.high = quantity.high;
    }
  }
  std::vector<std::pair<std::string, Capability>> out;
  for (const std::string& name : order) {
    const Series& one = series[name];
    if (const auto found = capability(one.values, one.low, one.high)) {
      out.emplace_back(name, *found);
    }
  }
  return out;
}

}  // namespace

Result<StatisticsReport> statistics(const std::vector<RunSummary>& runs, const std::string& by) {
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
  report.capabilities = capabilities_of(runs);
  return report;
}

std::string StatisticsReport::brief() const {
  const auto percent = [](const Proportion& part) {
    return part.of == 0
               ? std::string("-")
               : fmt::format("{:.1f} % ({} of {})", 100 * part.value(), part.count, part.of);
  };
  return fmt::format("{} runs of {} units; yield {}, first pass {}", all.runs, all.units,
                     percent(all.yield), percent(all.first_pass_yield));
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
  return json;
}

}  // namespace sixpoint::station
