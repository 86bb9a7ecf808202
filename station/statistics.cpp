#include "station/statistics.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <span>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "station/distributions.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// Shewhart's constants for ranges of two (ASTM STP 15D, table 27).
constexpr double kD2 = 1.128;
constexpr double kD4 = 3.267;

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

// The rules on distances from the centre in sigma. `z` holds the points that count, oldest first;
// true when the last one completes the pattern.
class NelsonRules {
 public:
  explicit NelsonRules(std::span<const double> z) : z_(z) {}

  bool holds(int rule) const {
    switch (rule) {
      case 1:
        return std::abs(z_.back()) > 3;
      case 2:
        return one_side(9, 9, 0);
      case 3:
        return rising(1) || rising(-1);
      case 4:
        return alternating();
      case 5:
        return one_side(2, 3, 2);
      case 6:
        return one_side(4, 5, 1);
      case 7:
        return all(15, [](double z) { return std::abs(z) < 1; });
      case 8:
        return all(8, [](double z) { return std::abs(z) > 1; });
      default:
        return false;
    }
  }

 private:
  std::span<const double> last(std::size_t count) const { return z_.last(count); }

  template <class Condition>
  bool all(std::size_t count, Condition&& condition) const {
    return z_.size() >= count &&
           std::all_of(last(count).begin(), last(count).end(), std::forward<Condition>(condition));
  }

  // The last point and `least` in all of the last `of` lie beyond `sigma` on one side.
  bool one_side(std::ptrdiff_t least, std::size_t of, double sigma) const {
    for (const double sign : {1.0, -1.0}) {
      const auto beyond = [&](double z) { return sign * z > sigma; };
      const auto points = last(std::min(of, z_.size()));
      if (beyond(z_.back()) && std::count_if(points.begin(), points.end(), beyond) >= least) {
        return true;
      }
    }
    return false;
  }

  bool rising(double sign) const {
    if (z_.size() < 6) {
      return false;
    }
    const auto points = last(6);
    for (std::size_t i = 1; i < points.size(); ++i) {
      if (!(sign * (points[i] - points[i - 1]) > 0)) {
        return false;
      }
    }
    return true;
  }

  bool alternating() const {
    if (z_.size() < 14) {
      return false;
    }
    const auto points = last(14);
    for (std::size_t i = 2; i < points.size(); ++i) {
      if (!((points[i] - points[i - 1]) * (points[i - 1] - points[i - 2]) < 0)) {
        return false;
      }
    }
    return true;
  }

  std::span<const double> z_;
};

}  // namespace

std::string_view nelson_rule(int rule) {
  static constexpr std::array<std::string_view, kNelsonRules> kRules = {
      "a point beyond 3 sigma",
      "nine points in a row on one side",
      "six points in a row rising or falling",
      "fourteen points in a row up and down",
      "two of three points beyond 2 sigma on one side",
      "four of five points beyond 1 sigma on one side",
      "fifteen points in a row within 1 sigma",
      "eight points in a row beyond 1 sigma"};
  return rule >= 1 && rule <= kNelsonRules ? kRules[static_cast<std::size_t>(rule) - 1] : "?";
}

ControlChart control_chart(std::string name, std::vector<double> values, std::size_t baseline,
                           double least_sigma, std::size_t from) {
  ControlChart chart;
  chart.name = std::move(name);
  chart.values = std::move(values);
  for (std::size_t i = 1; i < chart.values.size(); ++i) {
    chart.moving_ranges.push_back(std::abs(chart.values[i] - chart.values[i - 1]));
  }
  if (baseline < 2 || chart.values.size() < baseline) {
    return chart;
  }
  chart.baseline = baseline;
  chart.centre = mean_of(chart.values, baseline);
  chart.mean_range = mean_of(chart.moving_ranges, baseline - 1);
  chart.sigma = std::max(chart.mean_range / kD2, least_sigma);
  chart.lower = chart.centre - 3 * chart.sigma;
  chart.upper = chart.centre + 3 * chart.sigma;
  chart.upper_range = kD4 * chart.mean_range;
  if (!(chart.sigma > 0)) {
    return chart;
  }
  std::vector<double> z;
  for (std::size_t i = std::max(baseline, from); i < chart.values.size(); ++i) {
    z.push_back((chart.values[i] - chart.centre) / chart.sigma);
    for (int rule = 1; rule <= kNelsonRules; ++rule) {
      if (NelsonRules(z).holds(rule)) {
        chart.signals.push_back({i, rule});
      }
    }
  }
  return chart;
}

Json ControlChart::to_json() const {
  Json json;
  json["name"] = name;
  json["points"] = values.size();
  json["in_force"] = baseline > 0;
  json["baseline"] = baseline;
  json["centre"] = number(centre);
  json["sigma"] = number(sigma);
  json["lower"] = number(lower);
  json["upper"] = number(upper);
  json["mean_range"] = number(mean_range);
  json["upper_range"] = number(upper_range);
  json["values"] = Json::array();
  for (const double value : values) {
    json["values"].push_back(number(value));
  }
  json["signals"] = Json::array();
  for (const ChartSignal& signal : signals) {
    json["signals"].push_back(
        {{"point", signal.point}, {"rule", signal.rule}, {"meaning", nelson_rule(signal.rule)}});
  }
  return json;
}

// --- gage R&R ---

namespace {

struct Balanced {
  std::vector<std::string> parts;
  std::vector<std::string> operators;
  std::size_t trials = 0;
  std::vector<double> values;  // part, operator, trial
  double at(std::size_t part, std::size_t person, std::size_t trial) const {
    return values[(part * operators.size() + person) * trials + trial];
  }
};

Result<Balanced> balance(const std::vector<GageReading>& readings) {
  std::map<std::pair<std::string, std::string>, std::vector<double>> cells;
  Balanced out;
  const auto remember = [](std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      names.push_back(name);
    }
  };
  for (const GageReading& reading : readings) {
    if (!std::isfinite(reading.value)) {
      return fail(ErrorCode::bad_data, "a reading is not a finite number", "gage study",
                  "measure it again");
    }
    remember(out.parts, reading.part);
    remember(out.operators, reading.operator_name);
    cells[{reading.part, reading.operator_name}].push_back(reading.value);
  }
  constexpr std::size_t kMost = 1000;
  if (out.parts.size() < 2 || out.operators.size() < 2 || out.parts.size() > kMost ||
      out.operators.size() > kMost) {
    return fail(ErrorCode::bad_data,
                fmt::format("{} parts and {} operators make no study", out.parts.size(),
                            out.operators.size()),
                "gage study", "take ten parts, three operators and three trials of each");
  }
  for (const auto& [cell, values] : cells) {
    out.trials = std::max(out.trials, values.size());
  }
  for (const std::string& part : out.parts) {
    for (const std::string& person : out.operators) {
      const auto& values = cells[{part, person}];
      if (values.size() != out.trials || out.trials < 2) {
        return fail(
            ErrorCode::bad_data,
            fmt::format("operator '{}' measured part '{}' {} times, others {} times",
                        printable(person, 60), printable(part, 60), values.size(), out.trials),
            "gage study", "everybody measures every part equally often, at least twice each");
      }
      out.values.insert(out.values.end(), values.begin(), values.end());
    }
  }
  return out;
}

AnovaRow row_of(std::string source, double degrees_of_freedom, double sum_of_squares) {
  return {std::move(source), degrees_of_freedom,
          sum_of_squares,    sum_of_squares / degrees_of_freedom,
          std::nullopt,      std::nullopt};
}

void test_against(AnovaRow& row, const AnovaRow& error) {
  if (error.mean_square > 0) {
    row.f = row.mean_square / error.mean_square;
    row.p = f_upper_tail(*row.f, row.degrees_of_freedom, error.degrees_of_freedom);
  }
}

Json json_of(const std::vector<AnovaRow>& rows) {
  Json json = Json::array();
  for (const AnovaRow& row : rows) {
    json.push_back({{"source", row.source},
                    {"degrees_of_freedom", row.degrees_of_freedom},
                    {"sum_of_squares", number(row.sum_of_squares)},
                    {"mean_square", number(row.mean_square)},
                    {"f", number(row.f)},
                    {"p", number(row.p)}});
  }
  return json;
}

}  // namespace

std::string_view GageReport::judgement() const {
  return grr_percent < 10    ? "good"
         : grr_percent <= 30 ? "may do, depending on what it is for"
                             : "not good enough";
}

Result<GageReport> gage_rr(const std::vector<GageReading>& readings, const GageOptions& options) {
  SIXPOINT_ASSIGN(const Balanced study, balance(readings));
  const std::size_t parts = study.parts.size();
  const std::size_t operators = study.operators.size();
  const std::size_t trials = study.trials;
  const auto p = static_cast<double>(parts);
  const auto o = static_cast<double>(operators);
  const auto t = static_cast<double>(trials);

  std::vector<double> part_mean(parts);
  std::vector<double> operator_mean(operators);
  std::vector<double> cell_mean(parts * operators);
  double grand = 0;
  for (std::size_t i = 0; i < parts; ++i) {
    for (std::size_t j = 0; j < operators; ++j) {
      for (std::size_t k = 0; k < trials; ++k) {
        const double value = study.at(i, j, k);
        cell_mean[i * operators + j] += value / t;
        part_mean[i] += value / (o * t);
        operator_mean[j] += value / (p * t);
        grand += value / (p * o * t);
      }
    }
  }
  const auto square = [](double value) { return value * value; };
  double of_parts = 0;
  double of_operators = 0;
  double of_interaction = 0;
  double of_error = 0;
  for (std::size_t i = 0; i < parts; ++i) {
    of_parts += o * t * square(part_mean[i] - grand);
    for (std::size_t j = 0; j < operators; ++j) {
      const double cell = cell_mean[i * operators + j];
      of_interaction += t * square(cell - part_mean[i] - operator_mean[j] + grand);
      for (std::size_t k = 0; k < trials; ++k) {
        of_error += square(study.at(i, j, k) - cell);
      }
    }
  }
  for (const double mean : operator_mean) {
    of_operators += p * t * square(mean - grand);
  }

  GageReport report;
  report.parts = static_cast<int>(parts);
  report.operators = static_cast<int>(operators);
  report.trials = static_cast<int>(trials);
  AnovaRow part = row_of("part", p - 1, of_parts);
  AnovaRow person = row_of("operator", o - 1, of_operators);
  AnovaRow interaction = row_of("part x operator", (p - 1) * (o - 1), of_interaction);
  const AnovaRow error = row_of("repeatability", p * o * (t - 1), of_error);
  test_against(part, interaction);
  test_against(person, interaction);
  test_against(interaction, error);
  report.anova = {part, person, interaction, error};

  report.pooled = interaction.p && *interaction.p > options.pool_above_p;
  if (report.pooled) {
    const AnovaRow pool =
        row_of("repeatability", interaction.degrees_of_freedom + error.degrees_of_freedom,
               of_interaction + of_error);
    test_against(part, pool);
    test_against(person, pool);
    report.anova_pooled = {part, person, pool};
    report.repeatability = pool.mean_square;
    report.operator_variance = std::max(0.0, (person.mean_square - pool.mean_square) / (p * t));
    report.part_variance = std::max(0.0, (part.mean_square - pool.mean_square) / (o * t));
  } else {
    report.repeatability = error.mean_square;
    report.interaction = std::max(0.0, (interaction.mean_square - error.mean_square) / t);
    report.operator_variance =
        std::max(0.0, (person.mean_square - interaction.mean_square) / (p * t));
    report.part_variance = std::max(0.0, (part.mean_square - interaction.mean_square) / (o * t));
  }
  report.reproducibility = report.operator_variance + report.interaction;
  // By the values themselves: their sums of squares are never quite zero.
  const auto [least, most] = std::minmax_element(study.values.begin(), study.values.end());
  if (*least == *most || !(report.total() > 0)) {
    return fail(ErrorCode::bad_data, "all readings are alike", "gage study",
                "record more digits, or take parts that differ");
  }
  report.grr_percent = 100 * std::sqrt(report.grr() / report.total());
  if (options.tolerance) {
    report.grr_percent_of_tolerance =
        100 * options.study_factor * std::sqrt(report.grr()) / *options.tolerance;
  }
  // AIAG: 1.41 of the ratio, truncated. A gage without any scatter tells all apart.
  constexpr double kMostCategories = 1e6;
  report.ndc = static_cast<int>(
      std::min(kMostCategories, 1.41 * std::sqrt(report.part_variance / report.grr())));
  return report;
}

std::string GageReport::brief() const {
  return fmt::format("gage R&R {:.2f} % of total variation, {} distinct categories: {}",
                     grr_percent, ndc, judgement());
}

Json GageReport::to_json() const {
  Json json;
  json["parts"] = parts;
  json["operators"] = operators;
  json["trials"] = trials;
  json["grr_percent"] = number(grr_percent);
  json["grr_percent_of_tolerance"] = number(grr_percent_of_tolerance);
  json["ndc"] = ndc;
  json["judgement"] = judgement();
  json["usable"] = usable();
  json["pooled"] = pooled;
  json["anova"] = json_of(anova);
  json["anova_pooled"] = pooled ? json_of(anova_pooled) : Json(nullptr);
  const auto component = [&](double variance) {
    return Json{{"variance", variance},
                {"sd", std::sqrt(variance)},
                {"contribution_percent", 100 * variance / total()},
                {"study_percent", 100 * std::sqrt(variance / total())}};
  };
  json["components"] = {{"grr", component(grr())},
                        {"repeatability", component(repeatability)},
                        {"reproducibility", component(reproducibility)},
                        {"operator", component(operator_variance)},
                        {"part x operator", component(interaction)},
                        {"part", component(part_variance)},
                        {"total", component(total())}};
  return json;
}

Result<std::vector<GageReading>> parse_gage_csv(std::string_view csv, const std::string& where) {
  std::vector<GageReading> readings;
  std::array<std::size_t, 3> column{};  // part, operator, value
  std::size_t line_number = 0;
  const auto wrong = [&](std::string what) {
    return fail(ErrorCode::bad_data, std::move(what), fmt::format("{}:{}", where, line_number),
                "the first line is 'part,operator,value', and every line below has the three");
  };
  while (!csv.empty()) {
    const std::size_t end = std::min(csv.find('\n'), csv.size());
    std::string_view line = csv.substr(0, end);
    csv.remove_prefix(std::min(csv.size(), end + 1));
    ++line_number;
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) {
      line.remove_suffix(1);
    }
    if (line.empty()) {
      continue;
    }
    std::vector<std::string> fields(1);
    for (const char c : line) {
      if (c == ',') {
        fields.emplace_back();
      } else if (c != '"') {
        fields.back() += c;
      }
    }
    if (line_number == 1) {
      constexpr std::array<std::string_view, 3> kNames = {"part", "operator", "value"};
      for (std::size_t i = 0; i < kNames.size(); ++i) {
        const auto found = std::find(fields.begin(), fields.end(), kNames[i]);
        if (found == fields.end()) {
          return wrong(fmt::format("no column '{}'", kNames[i]));
        }
        column[i] = static_cast<std::size_t>(found - fields.begin());
      }
      continue;
    }
    if (fields.size() <= *std::max_element(column.begin(), column.end())) {
      return wrong("a line is too short");
    }
    const std::string& text = fields[column[2]];
    GageReading reading{fields[column[0]], fields[column[1]], 0};
    const auto [stop, status] =
        std::from_chars(text.data(), text.data() + text.size(), reading.value);
    if (status != std::errc() || stop != text.data() + text.size() ||
        !std::isfinite(reading.value)) {
      return wrong(fmt::format("'{}' is no number", printable(text, 60)));
    }
    readings.push_back(std::move(reading));
  }
  if (readings.empty()) {
    return wrong("no readings");
  }
  return readings;
}

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
