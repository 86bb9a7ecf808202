#include "station/statistics/gage_rr.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/text/csv_columns.h"
#include "station/statistics/distributions.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kMostCategories = 1e6;  // of a gage without any scatter

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
  const auto add_new = [](std::vector<std::string>& names, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      names.push_back(name);
    }
  };
  for (const GageReading& reading : readings) {
    if (!std::isfinite(reading.value)) {
      return fail(ErrorCode::bad_data, "a reading is not a finite number", "gage study",
                  "measure it again");
    }
    add_new(out.parts, reading.part);
    add_new(out.operators, reading.operator_name);
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
            "gage study", "every operator measures every part equally often, at least twice");
      }
      out.values.insert(out.values.end(), values.begin(), values.end());
    }
  }
  return out;
}

// No measurement does: scatter of 0.00 % and a million categories would come out.
bool repeats_itself(const Balanced& study) {
  for (std::size_t i = 0; i < study.parts.size(); ++i) {
    for (std::size_t j = 0; j < study.operators.size(); ++j) {
      for (std::size_t k = 1; k < study.trials; ++k) {
        if (study.at(i, j, k) != study.at(i, j, 0)) {
          return false;
        }
      }
    }
  }
  return true;
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

struct SumsOfSquares {
  double parts = 0;
  double operators = 0;
  double interaction = 0;
  double repeatability = 0;
};

SumsOfSquares sums_of_squares(const Balanced& study) {
  const std::size_t operators = study.operators.size();
  const auto p = static_cast<double>(study.parts.size());
  const auto o = static_cast<double>(operators);
  const auto t = static_cast<double>(study.trials);
  std::vector<double> part_mean(study.parts.size());
  std::vector<double> operator_mean(operators);
  std::vector<double> cell_mean(study.parts.size() * operators);
  double grand = 0;
  for (std::size_t i = 0; i < part_mean.size(); ++i) {
    for (std::size_t j = 0; j < operators; ++j) {
      for (std::size_t k = 0; k < study.trials; ++k) {
        const double value = study.at(i, j, k);
        cell_mean[i * operators + j] += value / t;
        part_mean[i] += value / (o * t);
        operator_mean[j] += value / (p * t);
        grand += value / (p * o * t);
      }
    }
  }
  const auto square = [](double value) { return value * value; };
  SumsOfSquares sums;
  for (std::size_t i = 0; i < part_mean.size(); ++i) {
    sums.parts += o * t * square(part_mean[i] - grand);
    for (std::size_t j = 0; j < operators; ++j) {
      const double cell = cell_mean[i * operators + j];
      sums.interaction += t * square(cell - part_mean[i] - operator_mean[j] + grand);
      for (std::size_t k = 0; k < study.trials; ++k) {
        sums.repeatability += square(study.at(i, j, k) - cell);
      }
    }
  }
  for (const double mean : operator_mean) {
    sums.operators += p * t * square(mean - grand);
  }
  return sums;
}

Json number_json(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json json_of(const std::vector<AnovaRow>& rows) {
  Json json = Json::array();
  for (const AnovaRow& row : rows) {
    json.push_back({{"source", row.source},
                    {"degrees_of_freedom", row.degrees_of_freedom},
                    {"sum_of_squares", row.sum_of_squares},
                    {"mean_square", row.mean_square},
                    {"f", number_json(row.f)},
                    {"p", number_json(row.p)}});
  }
  return json;
}

}  // namespace

std::string_view GageReport::judgement() const {
  return !usable()          ? "not good enough"
         : grr_percent < 10 ? "good"
                            : "may do, depending on what it is for";
}

Result<GageReport> gage_rr(const std::vector<GageReading>& readings, const GageOptions& options) {
  SIXPOINT_ASSIGN(const Balanced study, balance(readings));
  // By the values themselves: through rounding, their sums of squares are never exactly zero.
  const auto [least, most] = std::minmax_element(study.values.begin(), study.values.end());
  const bool all_equal = *least == *most;
  const auto p = static_cast<double>(study.parts.size());
  const auto o = static_cast<double>(study.operators.size());
  const auto t = static_cast<double>(study.trials);
  if (!all_equal && repeats_itself(study)) {
    return fail(ErrorCode::bad_data, "every repeat is the same to the last digit: a copy, no study",
                "gage study",
                "measure each part anew each time; a virtual unit with a seed repeats itself, and "
                "needs another noise=N each time");
  }
  const SumsOfSquares sums = sums_of_squares(study);
  if (!std::isfinite(sums.parts + sums.operators + sums.interaction + sums.repeatability)) {
    return fail(ErrorCode::bad_data, "the readings are too large to be computed with", "gage study",
                "take another unit, or look at the values");
  }

  GageReport report;
  report.parts = static_cast<int>(study.parts.size());
  report.operators = static_cast<int>(study.operators.size());
  report.trials = static_cast<int>(study.trials);
  AnovaRow part = row_of("part", p - 1, sums.parts);
  AnovaRow person = row_of("operator", o - 1, sums.operators);
  AnovaRow interaction = row_of("part x operator", (p - 1) * (o - 1), sums.interaction);
  AnovaRow error = row_of("repeatability", p * o * (t - 1), sums.repeatability);
  test_against(part, interaction);
  test_against(person, interaction);
  test_against(interaction, error);
  report.anova = {part, person, interaction, error};

  report.pooled = interaction.p && *interaction.p > options.pool_above_p;
  if (report.pooled) {
    error = row_of("repeatability", interaction.degrees_of_freedom + error.degrees_of_freedom,
                   sums.interaction + sums.repeatability);
    test_against(part, error);
    test_against(person, error);
    report.anova_pooled = {part, person, error};
  } else {
    report.interaction = std::max(0.0, (interaction.mean_square - error.mean_square) / t);
  }
  const double tested = (report.pooled ? error : interaction).mean_square;
  report.repeatability = error.mean_square;
  report.operator_variance = std::max(0.0, (person.mean_square - tested) / (p * t));
  report.part_variance = std::max(0.0, (part.mean_square - tested) / (o * t));
  report.reproducibility = report.operator_variance + report.interaction;
  if (all_equal || !(report.total() > 0)) {
    return fail(ErrorCode::bad_data, "all readings are alike", "gage study",
                "record more digits, or take parts that differ");
  }
  report.grr_percent = 100 * std::sqrt(report.grr() / report.total());
  if (options.tolerance) {
    report.grr_percent_of_tolerance =
        100 * options.study_factor * std::sqrt(report.grr()) / *options.tolerance;
  }
  // AIAG: 1.41 times the ratio, truncated.
  report.ndc = static_cast<int>(
      std::min(kMostCategories, 1.41 * std::sqrt(report.part_variance / report.grr())));
  return report;
}

std::string GageReport::brief() const {
  return fmt::format("gage R&R {:.2f} % of total variation, {} distinct categories: {}",
                     grr_percent, ndc, judgement());
}

Json GageReport::to_json() const {
  const auto component = [&](double variance) {
    return Json{{"variance", variance},
                {"sd", std::sqrt(variance)},
                {"contribution_percent", 100 * variance / total()},
                {"study_percent", 100 * std::sqrt(variance / total())}};
  };
  return {{"parts", parts},
          {"operators", operators},
          {"trials", trials},
          {"grr_percent", grr_percent},
          {"grr_percent_of_tolerance", number_json(grr_percent_of_tolerance)},
          {"ndc", ndc},
          {"judgement", judgement()},
          {"usable", usable()},
          {"pooled", pooled},
          {"anova", json_of(anova)},
          {"anova_pooled", pooled ? json_of(anova_pooled) : Json(nullptr)},
          {"components",
           {{"grr", component(grr())},
            {"repeatability", component(repeatability)},
            {"reproducibility", component(reproducibility)},
            {"operator", component(operator_variance)},
            {"part x operator", component(interaction)},
            {"part", component(part_variance)},
            {"total", component(total())}}}};
}

Result<std::vector<GageReading>> parse_gage_csv(std::string_view csv, const std::string& where) {
  constexpr std::array<std::string_view, 3> kNames = {"part", "operator", "value"};
  SIXPOINT_ASSIGN(const auto rows, csv_columns(csv, kNames, where));
  std::vector<GageReading> readings;
  for (const CsvRow& row : rows) {
    const std::string& text = row.fields[2];
    double value = 0;
    const auto [stop, status] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (status != std::errc() || stop != text.data() + text.size() || !std::isfinite(value)) {
      return fail(ErrorCode::bad_data, fmt::format("'{}' is no number", printable(text, 60)),
                  fmt::format("{}:{}", where, row.line),
                  "the values are numbers with a decimal point");
    }
    readings.push_back({row.fields[0], row.fields[1], value});
  }
  return readings;
}

}  // namespace sixpoint::station
