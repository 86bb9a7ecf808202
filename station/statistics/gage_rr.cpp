#include "station/gage_rr.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "station/distributions.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }
Json number(const std::optional<double>& value) { return value ? number(*value) : Json(nullptr); }

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

}  // namespace sixpoint::station
