// Gage R&R by crossed analysis of variance (docs/statistics.md): which part of the scatter of
// readings comes from the gage and the operators, and which from the parts.
//
//   SIXPOINT_ASSIGN(const auto readings, parse_gage_csv(csv, "study.csv"));
//   SIXPOINT_ASSIGN(const GageReport report, gage_rr(readings));
//   std::cout << report.brief();
//
// Values in any one unit; variances in its square. Source of the formulas: AIAG, Measurement
// Systems Analysis, 4th edition, chapter III. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"

namespace sixpoint::station {

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
  // Above this p, the interaction is chance and is pooled into repeatability. The AIAG example
  // (p = 0.97) is pooled with this and with the textbook's 0.05.
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
  // AIAG's two conditions:
  //
  // | %GRR of total variation | categories  | judgement                            | usable |
  // |-------------------------|-------------|--------------------------------------|--------|
  // | under 10                | five, more  | good                                 | yes    |
  // | to 30                   | five, more  | may do, depending on what it is for  | yes    |
  // | to 30                   | fewer       | not good enough                      | no     |
  // | above 30                | any         | not good enough                      | no     |
  std::string_view judgement() const;
  bool usable() const { return grr_percent <= 30 && ndc >= 5; }
  std::string brief() const;
  nlohmann::ordered_json to_json() const;
};
// Crossed and balanced: every operator measures every part the same number of times, at least
// twice; at least two of each. bad_data otherwise, naming what is missing.
Result<GageReport> gage_rr(const std::vector<GageReading>& readings,
                           const GageOptions& options = {});
// Columns part, operator, value (in any order, a header names them), comma separated, with quotes as
// RFC 4180 has them.
Result<std::vector<GageReading>> parse_gage_csv(std::string_view csv, const std::string& where);

}  // namespace sixpoint::station
