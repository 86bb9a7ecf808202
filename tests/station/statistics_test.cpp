#include "station/statistics.h"

#include <cmath>
#include <ostream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "station/distributions.h"

namespace sixpoint::station {
namespace {

using testing::Contains;
using testing::HasSubstr;

// Oracle: tables of NIST/SEMATECH e-Handbook 1.3.6.7.
TEST(Distributions, AsInTheTables) {
  EXPECT_NEAR(normal_quantile(0.975), 1.959964, 1e-6);
  EXPECT_NEAR(chi_square_quantile(0.025, 19), 8.907, 1e-3);
  EXPECT_NEAR(chi_square_quantile(0.975, 19), 32.852, 1e-3);
  EXPECT_NEAR(f_upper_tail(3.885, 2, 12), 0.05, 1e-4);
  EXPECT_TRUE(std::isnan(f_upper_tail(1, 0, 5)));
  EXPECT_TRUE(std::isnan(chi_square_quantile(0.5, -1)));
}

// --- control charts ---

bool has(const ControlChart& chart, std::size_t point, int rule) {
  for (const ChartSignal& signal : chart.signals) {
    if (signal.point == point && signal.rule == rule) {
      return true;
    }
  }
  return false;
}

// Oracle: NIST/SEMATECH e-Handbook 6.3.2.2, flowrates of ten batches: mean 50.81, mean moving range
// 1.8778, limits 55.8041 and 45.8159.
TEST(ControlChart, LimitsOfNistsExample) {
  const auto chart =
      control_chart("flow", {49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1}, 10);
  EXPECT_NEAR(chart.centre, 50.81, 1e-9);
  EXPECT_NEAR(chart.mean_range, 1.8778, 5e-5);
  EXPECT_NEAR(chart.upper, 55.8041, 5e-4);
  EXPECT_NEAR(chart.lower, 45.8159, 5e-4);
  EXPECT_NEAR(chart.upper_range, 3.267 * 1.8778, 5e-4);
  EXPECT_TRUE(chart.signals.empty());
}

// Oracle: the range of two normal values has the mean 2/sqrt(pi) and the variance 2 - 4/pi sigma
// squared; the tables give both constants with four digits. (statistics_oracle.py integrates them.)
TEST(ControlChart, ItsConstantsAreThoseOfTheNormalDistribution) {
  const auto chart = control_chart("c", {1, 2, 4, 3, 5}, 5);
  const double d2 = 2 / std::sqrt(M_PI);
  const double d3 = std::sqrt(2 - 4 / M_PI);
  EXPECT_NEAR(chart.mean_range / chart.sigma, d2, 5e-4);
  EXPECT_NEAR(chart.upper_range / chart.mean_range, 1 + 3 * d3 / d2, 1e-3);
}

// A baseline of mean 0 and sigma 1: moving ranges of 1.128.
std::vector<double> after_baseline(const std::vector<double>& more) {
  std::vector<double> values = {0.564, -0.564, 0.564, -0.564, 0.564, -0.564, 0.564, -0.564};
  values.insert(values.end(), more.begin(), more.end());
  return values;
}

struct RuleCase {
  int rule;
  std::vector<double> fires;   // at the last point, not before
  std::vector<double> silent;  // nearly
};
void PrintTo(const RuleCase& value, std::ostream* out) { *out << "rule " << value.rule; }
class NelsonRule : public testing::TestWithParam<RuleCase> {};

TEST_P(NelsonRule, FiresAtTheLastPointOfItsPatternOnly) {
  const auto [rule, fires, silent] = GetParam();
  for (const double sign : {1.0, -1.0}) {
    std::vector<double> loud = fires;
    std::vector<double> quiet = silent;
    for (auto* values : {&loud, &quiet}) {
      for (double& value : *values) {
        value *= sign;
      }
    }
    const auto chart = control_chart("c", after_baseline(loud), 8);
    ASSERT_NEAR(chart.sigma, 1, 1e-12);
    EXPECT_TRUE(has(chart, 7 + loud.size(), rule)) << nelson_rule(rule);
    for (std::size_t point = 8; point + 1 < 8 + loud.size(); ++point) {
      EXPECT_FALSE(has(chart, point, rule)) << nelson_rule(rule) << " at " << point;
    }
    const auto other = control_chart("c", after_baseline(quiet), 8);
    for (std::size_t point = 8; point < 8 + quiet.size(); ++point) {
      EXPECT_FALSE(has(other, point, rule)) << nelson_rule(rule) << " at " << point;
    }
  }
}

// Oracle: Nelson 1984, Figure 1.
INSTANTIATE_TEST_SUITE_P(
    All, NelsonRule,
    testing::Values(
        RuleCase{1, {0, 3.1}, {0, 2.9, 3}},
        RuleCase{2, {.1, .2, .1, .3, .1, .2, .1, .3, .1}, {.1, .2, .1, .3, .1, .2, .1, .3, -.1}},
        RuleCase{3, {-1, -.5, 0, .5, 1, 1.5}, {-1, -.5, 0, .5, 1, 1, 1.5}},
        RuleCase{4,
                 {0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1},
                 {0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 0}},
        RuleCase{5, {2.1, 0, 2.2}, {2.1, 0, 0, 2.2, 0, -2.1}},
        RuleCase{6, {1.1, 1.2, 0, 1.1, 1.3}, {1.1, 1.2, 0, 0, 1.1, 1.3}},
        RuleCase{7,
                 {.1, -.2, .1, .3, -.1, .2, .1, -.9, .1, .3, .1, -.2, .3, .1, .1},
                 {.1, -.2, .1, .3, -.1, .2, .1, -1.1, .1, .3, .1, -.2, .3, .1, .1}},
        RuleCase{8,
                 {1.1, -1.2, 1.5, 1.1, -1.1, -1.3, 1.2, 1.1},
                 {1.1, -1.2, 1.5, 0, -1.1, -1.3, 1.2, 1.1, 1.1}}),
    [](const auto& one) { return "Rule" + std::to_string(one.param.rule); });

TEST(ControlChart, IsNotInForceWithoutABaseline) {
  const auto chart = control_chart("c", {1, 2, 100}, 10);
  EXPECT_EQ(chart.baseline, 0U);
  EXPECT_TRUE(chart.signals.empty());
  EXPECT_FALSE(chart.to_json()["in_force"].get<bool>());
}

TEST(ControlChart, ALeastSigmaAndASignatureTakeSignalsAway) {
  EXPECT_TRUE(has(control_chart("c", after_baseline({4}), 8), 8, 1));
  EXPECT_FALSE(has(control_chart("c", after_baseline({4}), 8, 2), 8, 1));
  EXPECT_TRUE(control_chart("c", after_baseline({4}), 8, 0, 9).signals.empty());
  // Two beyond 2 sigma, one of them before the signature.
  EXPECT_TRUE(has(control_chart("c", after_baseline({2.5, 2.5}), 8), 9, 5));
  EXPECT_FALSE(has(control_chart("c", after_baseline({2.5, 2.5}), 8, 0, 9), 9, 5));
  // A gage without scatter has no sigma to judge by.
  EXPECT_TRUE(control_chart("c", {1, 1, 1, 5}, 3).signals.empty());
}

// --- gage R&R ---

// AIAG, Measurement Systems Analysis, 4th edition, table III-B 6: ten parts, three appraisers,
// three trials. The figures below were computed a second time, in exact fractions and by other
// formulas, and agree: statistics_oracle.py, which compares the program with them at every run.
constexpr double kAiag[3][3][10] = {
    {{0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36},
     {0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25},
     {0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31}},
    {{0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68},
     {0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62},
     {0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50}},
    {{0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49},
     {-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77},
     {-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16}}};

std::vector<GageReading> aiag() {
  std::vector<GageReading> readings;
  for (std::size_t trial = 0; trial < 3; ++trial) {
    for (std::size_t part = 0; part < 10; ++part) {
      for (std::size_t person = 0; person < 3; ++person) {
        readings.push_back({std::to_string(part + 1),
                            std::string(1, static_cast<char>('A' + person)),
                            kAiag[person][trial][part]});
      }
    }
  }
  return readings;
}

// Oracle: the published analysis of that table (AIAG MSA, tables III-B 7 and 8, and Minitab's
// Gageaiag example): sums of squares 88.3619, 3.1673, 0.3590, 2.7589; F of the interaction 0.434,
// p 0.974; pooled repeatability 0.03997, operator 0.05146, GRR 0.09143, part 1.08645; %GRR 27.86;
// ndc 4.
TEST(GageRr, AiagsExample) {
  const auto report = gage_rr(aiag());
  ASSERT_OK(report);
  ASSERT_EQ(report->anova.size(), 4U);
  EXPECT_NEAR(report->anova[0].sum_of_squares, 88.3619, 5e-5);
  EXPECT_NEAR(report->anova[1].sum_of_squares, 3.1673, 5e-5);
  EXPECT_NEAR(report->anova[2].sum_of_squares, 0.3590, 5e-5);
  EXPECT_NEAR(report->anova[3].sum_of_squares, 2.7589, 5e-5);
  EXPECT_NEAR(*report->anova[0].f, 492.291, 5e-3);
  EXPECT_NEAR(*report->anova[1].f, 79.406, 5e-3);
  EXPECT_NEAR(*report->anova[2].f, 0.434, 5e-4);
  EXPECT_NEAR(*report->anova[2].p, 0.974, 5e-4);
  EXPECT_TRUE(report->pooled);
  EXPECT_NEAR(*report->anova_pooled[0].f, 245.614, 5e-3);
  EXPECT_NEAR(report->repeatability, 0.03997, 5e-6);
  EXPECT_NEAR(report->operator_variance, 0.05146, 5e-6);
  EXPECT_NEAR(report->grr(), 0.09143, 5e-6);
  EXPECT_NEAR(report->part_variance, 1.08645, 5e-6);
  EXPECT_NEAR(report->grr_percent, 27.86, 5e-3);
  EXPECT_EQ(report->ndc, 4);
  EXPECT_EQ(report->judgement(), "may do, depending on what it is for");
  EXPECT_FALSE(report->usable()) << "fewer than five categories";
}

// Without pooling the components are those of the full table. Oracle: expected mean squares, by
// hand from the published mean squares (9.81799, 1.58363, 0.01994, 0.04598).
TEST(GageRr, WithoutPooling) {
  GageOptions options;
  options.pool_above_p = 1;
  options.tolerance = 8;
  const auto report = gage_rr(aiag(), options);
  ASSERT_OK(report);
  EXPECT_FALSE(report->pooled);
  EXPECT_NEAR(report->repeatability, 0.04598, 5e-6);
  EXPECT_EQ(report->interaction, 0) << "negative is none";
  EXPECT_NEAR(report->operator_variance, (1.58363 - 0.01994) / 30, 1e-6);
  EXPECT_NEAR(report->part_variance, (9.81799 - 0.01994) / 9, 1e-6);
  EXPECT_NEAR(*report->grr_percent_of_tolerance, 100 * 6 * std::sqrt(report->grr()) / 8, 1e-9);
}

TEST(GageRr, WhatIsNoStudyIsRefused) {
  auto readings = aiag();
  readings.pop_back();
  EXPECT_FAILS(gage_rr(readings), ErrorCode::bad_data);
  EXPECT_FAILS(gage_rr({}), ErrorCode::bad_data);
  EXPECT_FAILS(gage_rr({{"1", "A", 1}, {"1", "B", 1}, {"2", "A", 1}, {"2", "B", 1}}),
               ErrorCode::bad_data);
  EXPECT_FAILS(gage_rr({{"1", "A", 1}, {"1", "B", std::nan("")}}), ErrorCode::bad_data);
  std::vector<GageReading> alike = aiag();
  for (auto& reading : alike) {
    reading.value = 1;
  }
  EXPECT_FAILS(gage_rr(alike), ErrorCode::bad_data);
}

TEST(GageCsv, ColumnsInAnyOrder) {
  const auto readings = parse_gage_csv("value,part,operator\r\n1.5,7,Ada\r\n\r\n-2e-1,8,Bo\n", "f");
  ASSERT_OK(readings);
  ASSERT_EQ(readings->size(), 2U);
  EXPECT_EQ((*readings)[1].part, "8");
  EXPECT_EQ((*readings)[1].operator_name, "Bo");
  EXPECT_EQ((*readings)[1].value, -0.2);
  for (const char* bad : {"", "part,value\n1,2\n", "part,operator,value\n",
                          "part,operator,value\n1,A\n", "part,operator,value\n1,A,x\n",
                          "part,operator,value\n1,A,nan\n", "part,operator,value\n1,A,1.5mg\n"}) {
    EXPECT_FAILS(parse_gage_csv(bad, "f"), ErrorCode::bad_data);
  }
  EXPECT_EQ(parse_gage_csv("part,operator,value\n1,A,2\n1,A,x\n", "f.csv").error().where,
            "f.csv:3");
}

// --- capability ---

// Values with a given mean and standard deviation.
std::vector<double> values_with(std::size_t n, double mean, double sd) {
  std::vector<double> values;
  for (std::size_t i = 0; i < n; ++i) {
    values.push_back(i % 2 == 0 ? -1 : 1);
  }
  const double own_sd = std::sqrt(static_cast<double>(n) / static_cast<double>(n - 1));
  for (double& value : values) {
    value = mean + sd * value / own_sd;
  }
  return values;
}

// Oracle: Montgomery, Introduction to Statistical Quality Control, examples 8.4 (limits 38 and 62,
// n = 20, s = 1.75: Cp 2.29, 95 % from 1.57 to 3.01) and 8.5 (n = 20, Cpk 1.33: 0.88 to 1.77,
// computed there with two digits).
TEST(Capability, MontgomerysExamples) {
  const auto cp = capability(values_with(20, 50, 1.75), 38, 62);
  ASSERT_TRUE(cp);
  EXPECT_NEAR(cp->sd, 1.75, 1e-12);
  EXPECT_NEAR(*cp->cp, 2.29, 5e-3);
  EXPECT_NEAR(*cp->cp_low, 1.57, 1e-2);  // 2.29 x 0.68 there
  EXPECT_NEAR(*cp->cp_high, 3.01, 1e-2);
  const auto cpk = capability(values_with(20, 0, 1), std::nullopt, 3 * 1.33);
  ASSERT_TRUE(cpk);
  EXPECT_NEAR(cpk->cpk, 1.33, 1e-9);
  EXPECT_NEAR(cpk->cpk_low, 0.88, 6e-3);
  EXPECT_NEAR(cpk->cpk_high, 1.77, 1e-2);
  EXPECT_FALSE(cpk->cp) << "one limit has no width";
}

// Oracle: NIST/SEMATECH e-Handbook 6.1.6: limits 8 and 20, mean 16, sd 2: Cp 1.0, Cpk 0.6667.
TEST(Capability, NistsExample) {
  const auto found = capability(values_with(30, 16, 2), 8, 20);
  EXPECT_NEAR(*found->cp, 1, 1e-9);
  EXPECT_NEAR(found->cpk, 0.6667, 5e-5);
}

TEST(Capability, NeedsScatterAndALimit) {
  EXPECT_FALSE(capability({1}, 0, 2));
  EXPECT_FALSE(capability({1, 1, 1}, 0, 2));
  EXPECT_FALSE(capability({1, 2}, std::nullopt, std::nullopt));
}

// --- yields ---

// Oracle: Newcombe, Statistics in Medicine 17 (1998) 857, table I, method 3: 81 of 263 gives 0.2553
// to 0.3662, 0 of 20 gives 0 to 0.1611.
TEST(Proportion, WilsonsInterval) {
  const Proportion some = proportion(81, 263);
  EXPECT_NEAR(some.low, 0.2553, 5e-5);
  EXPECT_NEAR(some.high, 0.3662, 5e-5);
  EXPECT_NEAR(proportion(0, 20).high, 0.1611, 5e-5);
  EXPECT_EQ(proportion(0, 20).low, 0);
  EXPECT_TRUE(std::isnan(proportion(0, 0).value()));
}

RunSummary run_of(const std::string& serial, JigVerdict verdict, const std::string& station,
                  std::vector<std::string> codes = {}) {
  RunSummary run;
  run.serial = serial;
  run.verdict = verdict;
  run.station = station;
  run.seconds = 100;
  run.codes = std::move(codes);
  return run;
}

TEST(Statistics, YieldCountsUnitsAndFirstPassTheirFirstJudgedRun) {
  const std::vector<RunSummary> runs = {
      run_of("1", JigVerdict::fail, "A", {"zero_high", "noise_high"}),
      run_of("1", JigVerdict::pass, "A"),
      run_of("2", JigVerdict::stopped, "A", {"stopped"}),
      run_of("2", JigVerdict::conditional_pass, "B", {"noise_high"}),
      run_of("3", JigVerdict::conditional_fail, "B", {"noise_high"}),
      run_of("4", JigVerdict::inconclusive, "B", {"time_out"}),
  };
  const auto report = statistics(runs, "station");
  ASSERT_OK(report);
  EXPECT_EQ(report->all.runs, 6U);
  EXPECT_EQ(report->all.units, 4U);
  EXPECT_EQ(report->all.yield.count, 2U);
  EXPECT_EQ(report->all.yield.of, 3U) << "unit 4 was never judged";
  EXPECT_EQ(report->all.first_pass_yield.count, 1U);
  ASSERT_FALSE(report->all.failure_codes.empty());
  EXPECT_EQ(report->all.failure_codes[0], (std::pair<std::string, std::size_t>("noise_high", 2)))
      << "a conditional pass is no failure";
  EXPECT_EQ(report->all.seconds_per_unit_mean, 150);
  EXPECT_EQ(report->all.seconds_per_unit_median, 150);
  ASSERT_EQ(report->groups.size(), 2U);
  EXPECT_EQ(report->groups[0].name, "A");
  EXPECT_EQ(report->groups[0].runs, 3U);
  EXPECT_FAILS(statistics(runs, "moon"), ErrorCode::usage);
  EXPECT_OK(statistics({}, ""));
}

TEST(Statistics, CapabilityIsOfUnitsAndNotOfTheirRepeats) {
  std::vector<RunSummary> runs;
  for (int i = 0; i < 5; ++i) {
    runs.push_back(run_of(std::to_string(i), JigVerdict::fail, "A"));
    runs.back().quantities.push_back(
        {"noise_mg", "x", 100, 0, std::nullopt, 10, 0, JigVerdict::pass, ""});
    runs.push_back(run_of(std::to_string(i), JigVerdict::pass, "A"));
    runs.back().quantities.push_back(
        {"noise_mg", "x", 4 + 0.1 * i, 0, std::nullopt, 10, 0, JigVerdict::pass, ""});
  }
  const auto report = statistics(runs, "");
  ASSERT_EQ(report->capabilities.size(), 1U);
  EXPECT_EQ(report->capabilities[0].first, "noise_mg x");
  EXPECT_EQ(report->capabilities[0].second.n, 5U);
  EXPECT_NEAR(report->capabilities[0].second.mean, 4.2, 1e-12);
}

}  // namespace
}  // namespace sixpoint::station
