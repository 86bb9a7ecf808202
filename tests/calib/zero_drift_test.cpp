#include "calib/zero_drift.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

// Six sides, `rounds` times, a minute on each and ten seconds between. Each zero moves in a
// straight line, by half_span_mg from the middle of the file to its end, with white noise; the
// magnitude's error is the share of the upright axis.
std::vector<DriftPoint> drifting(const PerAxis<double>& half_span_mg, int rounds, double noise_mg) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0, noise_mg / 1000);
  std::vector<DriftPoint> points;
  const double half_s = 0.5 * (rounds * 6 * 70 - 10 - 4);
  for (int side = 0; side < 6 * rounds; ++side) {
    for (int k = 0; k < 15; ++k) {
      DriftPoint point;
      point.time_s = 70.0 * side + 4.0 * k;
      point.duration_s = 4;
      point.direction = side % 6;
      const tests::Vector& n = tests::kSixSides[static_cast<std::size_t>(side % 6)];
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double zero_g =
            half_span_mg[a] / 1000 * (point.time_s - half_s) / half_s + normal(random);
        point.mean_g[a] = n[a] + zero_g;
        point.error_g += n[a] * zero_g;
      }
      points.push_back(point);
    }
  }
  return points;
}

TEST(ZeroDrift, ALineIsMeasuredAndShown) {
  const PerAxis<double> rates = {6, -8, 4};
  const auto drift = zero_drift(drifting(rates, 2, 0.3));
  ASSERT_TRUE(drift);
  EXPECT_TRUE(drift->shown);
  EXPECT_EQ(drift->visits, 12);
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_NEAR(drift->half_span_mg[a], rates[a], 3 * drift->standard_uncertainty_mg[a]) << a;
    EXPECT_LT(drift->standard_uncertainty_mg[a], 2) << a;
  }
  EXPECT_NEAR(drift->at_rest_s, 12 * 15 * 4, 1e-9) << "fifteen blocks of 4 s a side";
  EXPECT_GT(drift->shown_mg(), std::sqrt(36 + 64 + 16) / 2);
}

// What the clock jumps over while the unit lies on one side was not sampled.
TEST(ZeroDrift, AJumpOfTheClockIsNoTimeAtRest) {
  auto points = drifting({0, 0, 0}, 1, 0.3);
  const double last_s = points.back().time_s;
  for (std::size_t i = points.size() - 7; i < points.size(); ++i) {
    points[i].time_s += 3600;
  }
  const auto drift = zero_drift(points);
  ASSERT_TRUE(drift);
  EXPECT_NEAR(drift->at_rest_s, 6 * 15 * 4, 1e-9);
  EXPECT_NEAR(drift->within_s, last_s + 3600 + 4, 1e-9);
}

TEST(ZeroDrift, NoiseAloneIsNoDrift) {
  const auto drift = zero_drift(drifting({0, 0, 0}, 2, 0.3));
  ASSERT_TRUE(drift);
  EXPECT_FALSE(drift->shown);
  EXPECT_EQ(drift->shown_mg(), 0);
  EXPECT_LT(drift->chi2, 16.3);
}

// One round hides more of a drift than two.
TEST(ZeroDrift, ASecondRoundBoundsWhatCanHide) {
  const auto one = zero_drift(drifting({0, 0, 0}, 1, 0.3));
  const auto two = zero_drift(drifting({0, 0, 0}, 2, 0.3));
  ASSERT_TRUE(one);
  ASSERT_TRUE(two);
  EXPECT_LT(two->hidden_mg(), one->hidden_mg());
  EXPECT_GE(one->allowance_mg(), one->hidden_mg());
}

TEST(ZeroDrift, NoAnswerForASingleVisitOrAWeek) {
  EXPECT_FALSE(zero_drift({}));
  const auto points = drifting({5, 5, 5}, 1, 0.3);
  EXPECT_FALSE(zero_drift(std::span(points).first(15)));
  auto long_file = points;
  long_file.back().time_s = 4 * 3600;
  EXPECT_FALSE(zero_drift(long_file));
}

}  // namespace
}  // namespace sixpoint::calib
