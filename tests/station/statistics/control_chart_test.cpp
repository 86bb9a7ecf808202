#include "station/statistics/control_chart.h"

#include <cmath>
#include <ostream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace sixpoint::station {
namespace {

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

}  // namespace
}  // namespace sixpoint::station
