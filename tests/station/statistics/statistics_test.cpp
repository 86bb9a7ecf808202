#include "station/statistics/statistics.h"

#include <cmath>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"

namespace sixpoint::station {
namespace {

using testing::Contains;
using testing::HasSubstr;

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

// The rows of the table of capability().
TEST(Capability, NeedsFiveValuesScatterAndALimit) {
  EXPECT_FALSE(capability({}, 0, 2));
  EXPECT_FALSE(capability({1, 2, 3, 4}, 0, 9));
  EXPECT_FALSE(capability({1, 1, 1, 1, 1}, 0, 2));
  EXPECT_FALSE(capability({1, 2, 3, 4, 5}, std::nullopt, std::nullopt));
  const auto one = capability({1, 2, 3, 4, 5}, std::nullopt, 9);
  ASSERT_TRUE(one);
  EXPECT_FALSE(one->cp);
  EXPECT_TRUE(capability({1, 2, 3, 4, 5}, 0, 9)->cp);
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

// The rows of the table of statistics(). Oracle: Cpk by hand, (high - mean) / (3 sd) of the values
// 4 to 8: mean 6, variance 2.5; the built-in limit is 10.
TEST(Statistics, CapabilityGoesByTheLimitsThatAreNamedOrByThoseOfAllRuns) {
  const auto runs_with = [](const std::vector<double>& highs) {
    std::vector<RunSummary> runs;
    for (std::size_t i = 0; i < highs.size(); ++i) {
      runs.push_back(run_of(std::to_string(i), JigVerdict::pass, "A"));
      runs.back().quantities.push_back({"noise_mg", "x", 4 + static_cast<double>(i), 0,
                                        std::nullopt, highs[i], 0, JigVerdict::pass, ""});
    }
    return runs;
  };
  const auto cpk = [](const Result<StatisticsReport>& report) {
    return report->capabilities.empty() ? -1 : report->capabilities[0].second.cpk;
  };
  const Limits limits = default_limits();
  ASSERT_EQ(limits.of("noise_mg").high, 10);
  for (const std::vector<double>& highs :
       {std::vector<double>{12, 12, 12, 12, 12}, {12, 12, 12, 12, 15}, {15, 12, 12, 12, 12}}) {
    const auto by_given = statistics(runs_with(highs), "", &limits);
    EXPECT_NEAR(cpk(by_given), 4 / (3 * std::sqrt(2.5)), 1e-12);
    EXPECT_TRUE(by_given->limits_differ.empty());
  }
  const auto by_shared = statistics(runs_with({12, 12, 12, 12, 12}), "");
  EXPECT_NEAR(cpk(by_shared), 6 / (3 * std::sqrt(2.5)), 1e-12);
  EXPECT_TRUE(by_shared->limits_differ.empty());
  for (const std::vector<double>& highs :
       {std::vector<double>{12, 12, 12, 12, 15}, {15, 12, 12, 12, 12}}) {
    const auto differing = statistics(runs_with(highs), "");
    EXPECT_TRUE(differing->capabilities.empty());
    EXPECT_EQ(differing->limits_differ, std::vector<std::string>{"noise_mg x"});
    EXPECT_EQ(differing->to_json()["limits_differ"][0], "noise_mg x");
  }
}

}  // namespace
}  // namespace sixpoint::station
