#include "repair/compare/align.h"

#include <array>
#include <cmath>
#include <functional>

#include <gmock/gmock.h>

#include "base/random.h"

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

// The magnitude of what moves so, by a clock that shows lag_s more, in counts of 256 LSB/g.
Trace in_counts(const std::function<std::array<double, 3>(double)>& motion_g, double lag_s,
                double gain = 1, double noise_g = 0) {
  Random random(static_cast<std::uint64_t>(std::llround(1000 + lag_s * 10)));
  std::vector<float> values;
  for (int i = 0; i < 18000; ++i) {
    double square = 0;
    for (const double axis_g : motion_g(i / 30.0 - lag_s)) {
      const double counts = std::round(256 * (gain * axis_g + noise_g * random.normal()));
      square += counts * counts;
    }
    values.push_back(static_cast<float>(std::sqrt(square) / 256));
  }
  return Trace::from_magnitudes("x", 1000, 30, std::move(values));
}

// A minute aside it fits to 0.91, but only where it belongs to 0.9999. Oracle: the lag built in.
TEST(Align, MotionThatNearlyRepeatsHasOneLag) {
  const auto moved = [](double t) -> std::array<double, 3> {
    return {0.3 * std::sin(1.1 * t) + 0.5 * std::sin(0.37 * t + 1) * std::sin(5 * t),
            0.4 * std::sin(0.7 * t + 2) * std::cos(3.3 * t),
            1 + 0.3 * std::sin(2.3 * t) * std::sin(0.21 * t)};
  };
  const Trace first = in_counts(moved, 0);
  for (const auto& [lag_s, gain] : std::vector<std::pair<double, double>>{
           {-1.5, 1.1}, {-1.5, 1}, {-1, 1}, {0.3, 1}, {0.5, 1}, {1.5, 1}, {-2.5, 1}, {2.4, 1}}) {
    PairComparison result;
    const Line line = align(first, in_counts(moved, lag_s, gain), {}, result);
    EXPECT_TRUE(result.aligned) << lag_s;
    EXPECT_NEAR(line.at(1300), lag_s, 0.002);
    EXPECT_LT(result.lag_uncertainty_s, 0.002) << lag_s;
    EXPECT_TRUE(result.remarks.empty()) << result.remarks.front();
  }
}

// Bursts of one strength every ten seconds, no two alike: two dozen lags swell alike.
TEST(Align, OfManyLagsThatSwellAlikeTheOneThatFitsIsFound) {
  const auto moved = [](double t) -> std::array<double, 3> {
    double sum = 0;
    for (int k = 0; k < 40; ++k) {
      const double hz = 0.3 + 4 * std::fmod(0.618034 * (k + 1), 1.0);
      sum += 0.04 * std::sin(2 * M_PI * hz * t + k * k);
    }
    return {0, 0, 1 + (std::fmod(t + 4000, 10) < 5 ? sum : 0)};
  };
  const Trace first = in_counts(moved, 0);
  for (const double lag_s : {-98.5, -31.5, -0.5, 23.25, 67.5}) {
    PairComparison result;
    const Line line = align(first, in_counts(moved, lag_s), {}, result);
    EXPECT_TRUE(result.aligned) << lag_s;
    EXPECT_NEAR(line.at(1300), lag_s, 0.002);
    EXPECT_TRUE(result.remarks.empty()) << lag_s;
  }
}

// Oracle: what repeats every 30 s and never ends fits at the lag built in and at each multiple of
// 30 s from it up to 120 s: nobody can tell, and the farthest bounds the error.
TEST(Align, OfLagsThatNoiseDoesNotTellApartTheDistanceIsSaid) {
  const auto moved = [](double t) -> std::array<double, 3> {
    double sum = 0;
    for (int k = 1; k < 60; ++k) {
      sum += 0.05 * std::sin(2 * M_PI * k / 30 * t + k * k);
    }
    return {0, 0, 1 + sum};
  };
  const Trace first = in_counts(moved, 0, 1, 0.004);
  for (const double lag_s : {-1.5, 0.0, 7.25}) {
    PairComparison result;
    const Line line = align(first, in_counts(moved, lag_s, 1, 0.004), {}, result);
    EXPECT_TRUE(result.aligned) << lag_s;
    const double off_s = line.at(1300) - lag_s;
    EXPECT_NEAR(off_s, 30 * std::round(off_s / 30), 0.003);
    EXPECT_LE(std::abs(off_s), result.lag_uncertainty_s);
    double farthest_s = 0;
    for (int k = -8; k <= 8; ++k) {
      if (std::abs(lag_s + 30 * k) <= 120) {
        farthest_s = std::max(farthest_s, std::abs(lag_s + 30 * k - line.at(1300)));
      }
    }
    EXPECT_NEAR(result.lag_uncertainty_s, farthest_s, 0.01);
    ASSERT_EQ(result.remarks.size(), 1U);
    EXPECT_THAT(result.remarks[0], testing::HasSubstr("the motion is periodic"));
  }
}

}  // namespace
}  // namespace sixpoint::repair
