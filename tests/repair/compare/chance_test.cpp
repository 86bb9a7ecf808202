// What chance gives as well is no alignment, and what is related is one.
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "base/random.h"
#include "expect_result.h"
#include "repair/compare/align.h"
#include "sim/recording.h"
#include "sim/scenario.h"

namespace sixpoint::repair {
namespace {

// Four parts that lie on a line with even odds. Oracle: the binomial distribution, by hand.
TEST(Agreement, ChanceIsThatOfTheBinomialDistribution) {
  Agreement agreement;
  agreement.chances = {0.5, 0.5, 0.5, 0.5};
  for (const auto& [agreeing, sixteenths] :
       std::vector<std::pair<std::size_t, double>>{{0, 16}, {1, 15}, {3, 5}, {4, 1}, {5, 0}}) {
    agreement.agreeing = agreeing;
    EXPECT_NEAR(agreement.by_chance(), sixteenths / 16, 1e-12) << agreeing;
  }
  agreement.agreeing = 3;
  agreement.lines_tried = 2;
  EXPECT_NEAR(agreement.by_chance(), 5 / 8.0, 1e-12);
  agreement.lines_tried = 1000;
  EXPECT_EQ(agreement.by_chance(), 1) << "no more than certain";
  agreement.swelling = 0.1;
  EXPECT_NEAR(agreement.by_chance(), 0.1, 1e-12);
  agreement.swelling = 1e-20;
  EXPECT_NEAR(agreement.by_chance(), 0.01, 1e-12) << "swelling alone is no alignment";
}

Agreement agreement_of_parts(std::size_t agreeing, double lines_tried) {
  Agreement agreement;
  agreement.agreeing = agreeing;
  agreement.chances.assign(agreeing, 0.01);
  agreement.lines_tried = lines_tried;
  return agreement;
}

// The table in align.h, row by row. Three parts of one in a hundred are one in a million.
TEST(Agreement, AnAlignmentFollowsTheTable) {
  EXPECT_FALSE(is_alignment(agreement_of_parts(0, 1e-9), 0, 10));
  EXPECT_FALSE(is_alignment(agreement_of_parts(1, 1e-9), 0, 10));
  EXPECT_FALSE(is_alignment(agreement_of_parts(2, 1e-9), 0, 10));
  EXPECT_FALSE(is_alignment(agreement_of_parts(3, 101), 0, 10));
  EXPECT_FALSE(is_alignment(agreement_of_parts(3, 99), 10.1, 10));
  EXPECT_FALSE(is_alignment(agreement_of_parts(3, 99), -10.1, 10));
  EXPECT_TRUE(is_alignment(agreement_of_parts(3, 99), 10, 10));
  EXPECT_TRUE(is_alignment(agreement_of_parts(3, 99), -10, 10));
}

// A unit of the simulator that is worn, as `sixpoint simulate` makes it.
Trace worn(std::uint64_t unit_seed, std::uint64_t motion_seed, int duration_s, int late_s,
           double clock_ppm) {
  const auto scenario = sim::parse_scenario(fmt::format(
      R"({{"seed":{},"start":"2015-04-09T14:{:02}:{:02}Z","motions":[{{"kind":"free_living",)"
      R"("duration_s":{},"seed":{}}}],"effects":[{{"name":"clock_error",)"
      R"("parameters":{{"ppm":{}}}}}]}})",
      unit_seed, (late_s + 240) / 60, (late_s + 240) % 60, duration_s, motion_seed, clock_ppm));
  EXPECT_OK(scenario);
  MemoryEnv memory;
  EXPECT_OK(sim::write_recording(memory.files, "unit.gt3x", *scenario));
  const auto trace = Trace::load(memory.files, "unit.gt3x");
  EXPECT_OK(trace);
  return *trace;
}

struct WornPair {
  Trace a;
  Trace b;
  double lag_s;
  double drift_ppm;
};

// Ten minutes and twenty, by turns.
std::vector<WornPair> worn_pairs() {
  Random random(11);
  std::vector<WornPair> pairs;
  for (std::uint64_t i = 0; i < 40; ++i) {
    const int duration_s = i % 2 == 0 ? 600 : 1200;
    const int late_s = static_cast<int>(std::floor(random.uniform() * 120)) - 60;
    const double ppm = std::round(random.uniform() * 200 - 100);
    pairs.push_back({worn(3000 + i, 700 + i, duration_s, 0, 0),
                     worn(4000 + i, 700 + i, duration_s, late_s, ppm), static_cast<double>(late_s),
                     ppm});
  }
  return pairs;
}

// Oracle: the lags and the clocks' errors of the scenarios; two motions with nothing in common.
// The stated error is that of 99 of 100: of forty, one may lie outside.
TEST(Compare, RelatedPairsAreAlignedAndUnrelatedOnesAreNot) {
  const auto pairs = worn_pairs();
  std::size_t aligned = 0;
  std::size_t within = 0;
  std::size_t by_chance = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto related = compare(pairs[i].a, pairs[i].b);
    ASSERT_OK(related);
    aligned += related->aligned ? 1 : 0;
    const double lag_s =
        pairs[i].lag_s + pairs[i].drift_ppm * 1e-6 * (related->lag_at_s - pairs[i].a.start_s());
    EXPECT_NEAR(related->lag_s, lag_s, 0.01) << i;
    EXPECT_GT(related->lag_uncertainty_s, 0) << i;
    within += std::abs(related->lag_s - lag_s) <= related->lag_uncertainty_s ? 1 : 0;
    const auto unrelated = compare(pairs[i].a, pairs[(i + 2) % pairs.size()].b);
    ASSERT_OK(unrelated);
    by_chance += unrelated->aligned ? 1 : 0;
    EXPECT_EQ(unrelated->minutes_used, 0U);
    EXPECT_FALSE(unrelated->remarks.empty()) << i;
  }
  std::printf("related: %zu of %zu aligned, %zu within the stated error; unrelated: %zu aligned\n",
              aligned, pairs.size(), within, by_chance);
  EXPECT_EQ(aligned, pairs.size());
  EXPECT_GE(within + 1, pairs.size());
  EXPECT_EQ(by_chance, 0U);
}

// Two units whose clocks are seven seconds apart.
TEST(Compare, NothingIsFoundBeyondTheGreatestLag) {
  const Trace a = worn(7, 5, 1200, 0, 0);
  const Trace b = worn(9, 5, 1200, 7, 0);
  for (const double max_lag_s : {0.0, 1.0, 3.0, 5.0, 6.0, 6.9}) {
    const auto result = compare(a, b, {.max_lag_s = max_lag_s});
    ASSERT_OK(result);
    EXPECT_FALSE(result->aligned) << max_lag_s << " gives " << result->lag_s;
    EXPECT_EQ(result->lag_s, 0);
  }
  for (const double max_lag_s : {7.0, 7.5, 120.0}) {
    const auto result = compare(a, b, {.max_lag_s = max_lag_s});
    ASSERT_OK(result);
    EXPECT_TRUE(result->aligned) << max_lag_s;
    EXPECT_NEAR(result->lag_s, 7, 0.005);
  }
}

}  // namespace
}  // namespace sixpoint::repair
