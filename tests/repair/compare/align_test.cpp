#include "repair/compare/align.h"

#include <cmath>

#include <gtest/gtest.h>

namespace sixpoint::repair {
namespace {

TEST(Align, ALineIsALagAndASlope) {
  const Line line{0.5, 1e-6, 1000};
  EXPECT_EQ(line.at(1000), 0.5);
  EXPECT_NEAR(line.at(2000), 0.501, 1e-12);
}

TEST(Align, WithoutMotionThereIsNoLag) {
  const Trace still = Trace::from_magnitudes("a", 0, 30, std::vector<float>(9000, 1.0F));
  PairComparison result;
  const Line line = align(still, still, {}, result);
  EXPECT_FALSE(result.aligned);
  EXPECT_EQ(line.lag_s, 0);
  ASSERT_EQ(result.remarks.size(), 1U);
}

// Three seconds of a chirp every ten seconds, the same in both, one clock 7 s ahead.
TEST(Align, FindsAWholeLag) {
  const auto made = [](double start_s) {
    std::vector<float> values;
    for (int i = 0; i < 9000; ++i) {
      const double t = i / 30.0;
      const double burst = std::fmod(t, 10 + std::floor(t / 50)) < 3 ? 1 : 0;
      values.push_back(static_cast<float>(1 + burst * 0.3 * std::sin(3 * t + 0.02 * t * t)));
    }
    return Trace::from_magnitudes("x", start_s, 30, std::move(values));
  };
  PairComparison result;
  const Line line = align(made(1000), made(1007), {}, result);
  EXPECT_TRUE(result.aligned);
  EXPECT_NEAR(line.at(1150), 7, 0.01);
}

// A shaker that goes on and off: by swelling and fading alone, each multiple of its period is a
// lag.
TEST(Align, MotionThatGoesOnAndOffByAPeriodHasOneLag) {
  const auto moved = [](double t) {
    double sum = 0;
    for (int k = 0; k < 40; ++k) {  // never the same again
      const double hz = 0.3 + 4 * std::fmod(0.618034 * (k + 1), 1.0);
      sum += 0.04 * std::sin(2 * M_PI * hz * t + k * k);
    }
    return 1 + (std::fmod(t + 4100, 41) < 20.5 ? sum : 0);
  };
  // Two clocks: at one moment the second one shows lag_s more.
  const auto recorded = [&](double lag_s) {
    std::vector<float> values;
    for (int i = 0; i < 9000; ++i) {
      values.push_back(static_cast<float>(moved(i / 30.0 - lag_s)));
    }
    return Trace::from_magnitudes("x", 1000, 30, std::move(values));
  };
  const Trace first = recorded(0);
  for (const double lag_s : {-6.1, -4.37, -2.2, -0.4, 0.4, 1.63, 3.9, 6.1}) {
    PairComparison result;
    const Line line = align(first, recorded(lag_s), {}, result);
    EXPECT_TRUE(result.aligned) << lag_s;
    EXPECT_NEAR(line.at(1150), lag_s, 0.01);
  }
}

}  // namespace
}  // namespace sixpoint::repair
