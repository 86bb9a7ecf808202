#include "station/records/gap_trends.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "expect_result.h"
#include "station/records/made_run.h"

namespace sixpoint::station {
namespace {

std::vector<StoredRun> runs_on(const std::string& jig, std::size_t units,
                               const std::array<double, 2>& jig_deg, std::uint64_t seed) {
  Random random(seed, 1);
  std::vector<StoredRun> runs;
  for (std::size_t u = 0; u < units; ++u) {
    const std::array<double, 3> own = {0.2 * random.normal(), 0.2 * random.normal(),
                                       0.2 * random.normal()};
    runs.push_back(made_run(jig + std::to_string(u), jig, own, jig_deg));
  }
  return runs;
}

TEST(GapTrends, SkewIsReadOffTheFaces) {
  const auto skew = skew_of_run(made_run("A", "j", {0, 0, 0}, {0.3, 0}));
  ASSERT_OK(skew);
  double most = 0;
  for (const double x : *skew) {
    most = std::max(most, std::abs(x));
  }
  EXPECT_NEAR(most, 0.3, 0.002);
  EXPECT_FAILS(skew_of_run({"x", "s", "jig", "", "", "{}"}), ErrorCode::bad_data);
  EXPECT_FAILS(skew_of_run({"x", "s", "jig", "", "", "nonsense"}), ErrorCode::bad_data);
}

TEST(GapTrends, SameTiltOnEveryUnitIsTheJigs) {
  auto runs = runs_on("level", 14, {0, 0}, 1);
  for (auto& run : runs_on("crooked", 14, {0.4, -0.2}, 2)) {
    runs.push_back(run);
  }
  for (auto& run : runs_on("rare", 3, {0.4, -0.2}, 3)) {
    runs.push_back(run);
  }
  const GapTrends trends = find_trends(runs);
  ASSERT_EQ(trends.jigs.size(), 3U);
  for (const JigTrend& trend : trends.jigs) {
    EXPECT_EQ(trend.cause, trend.jig == "crooked" ? TrendCause::jig
                           : trend.jig == "rare"  ? TrendCause::too_few_units
                                                  : TrendCause::unit)
        << trend.jig << " " << trend.chance;
  }
}

TEST(GapTrends, WhatTwoJigsShareIsTheStations) {
  auto runs = runs_on("a", 12, {0.4, 0.3}, 4);
  for (auto& run : runs_on("b", 12, {0.4, 0.3}, 5)) {
    runs.push_back(run);
  }
  for (const JigTrend& trend : find_trends(runs).jigs) {
    EXPECT_EQ(trend.cause, TrendCause::station) << trend.chance;
  }
}

// The oracle is the test's own definition: with level jigs the chance must be uniform.
TEST(GapTrends, LevelJigsAreRarelyBlamed) {
  int blamed = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const auto trends = find_trends(runs_on("level", 10, {0, 0}, 100 + seed));
    blamed += trends.jigs.front().cause == TrendCause::jig ? 1 : 0;
  }
  EXPECT_LE(blamed, 10) << "four in a hundred are expected";
}

}  // namespace
}  // namespace sixpoint::station
