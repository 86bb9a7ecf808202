#include "sim/motion.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace sixpoint::sim {
namespace {

Eigen::Vector3d force_at(Motion& motion, double time_s) {
  MotionState state;
  motion.at(time_s, state);
  return state.rotation * state.force_lab_g;
}

TEST(Motion, StillPosesPointUp) {
  const Eigen::Vector3d directions[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0},     {0, -1, 0},
                                        {0, 0, 1}, {0, 0, -1}, {0.3, -2, 0.7}};
  for (const Eigen::Vector3d& up : directions) {
    const auto motion = still(rotation_with_up(up), 0.998);
    EXPECT_LT((force_at(*motion, 12) - 0.998 * up.normalized()).norm(), 1e-12);
  }
}

// Oracle: closed form of a sine along x with the unit's z up.
TEST(Motion, ShakerIsASine) {
  const auto motion = shaker(Eigen::Matrix3d::Identity(), {Eigen::Vector3d(2, 0, 0), 4, 0.8, 0.3});
  for (const double t : {0.0, 0.01, 1.23}) {
    const Eigen::Vector3d expected(0.8 * std::sin(2 * std::numbers::pi * 4 * t + 0.3), 0, 1);
    EXPECT_LT((force_at(*motion, t) - expected).norm(), 1e-12);
  }
}

TEST(Motion, TurnBeginsAndEndsAtRestAndShakesBetween) {
  const Eigen::Matrix3d from = rotation_with_up({0, 0, 1});
  const Eigen::Matrix3d to = rotation_with_up({1, 0, 0});
  const auto motion = turn(from, to, 2, 9);
  EXPECT_LT((force_at(*motion, 0) - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  EXPECT_LT((force_at(*motion, 2) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
  EXPECT_LT((force_at(*motion, 5) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
  double most = 0;
  for (double t = 0; t < 2; t += 0.01) {
    most = std::max(most, std::abs(force_at(*motion, t).norm() - 1));
  }
  EXPECT_GT(most, 0.01);
  EXPECT_LT(most, 0.2);
}

// Without reach in all six directions nothing can be calibrated from a day.
TEST(Motion, FreeLivingRestsInManyDirectionsAndMovesWithoutJumps) {
  const auto motion = free_living(4 * 3600, 11);
  const auto again = free_living(4 * 3600, 11);
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
  int still_samples = 0;
  double step = 0;
  double most_g = 0;
  Eigen::Vector3d before = force_at(*motion, 0);
  const int samples = 4 * 3600 * 20;
  for (int i = 1; i < samples; ++i) {
    const Eigen::Vector3d now = force_at(*motion, i / 20.0);
    step = std::max(step, (now - before).norm());
    most_g = std::max(most_g, now.norm());
    if (now == before) {
      ++still_samples;
      low = low.cwiseMin(now);
      high = high.cwiseMax(now);
      EXPECT_NEAR(now.norm(), 1, 1e-12);
    }
    before = now;
  }
  EXPECT_EQ(force_at(*again, 1234.5), force_at(*motion, 1234.5));
  EXPECT_GT(still_samples, samples / 5);
  EXPECT_LT(still_samples, samples * 4 / 5);
  EXPECT_GT(low.cwiseAbs().minCoeff(), 0.3);
  EXPECT_GT(high.minCoeff(), 0.3);
  EXPECT_GT(most_g, 1.5);
  EXPECT_LT(most_g, 8);
  EXPECT_LT(step, 3) << "20 Hz steps of a few g at most";
}

TEST(Motion, SequenceGoesForthAndBack) {
  MotionSequence sequence;
  sequence.add(still(rotation_with_up({0, 0, 1})), 10);
  sequence.add(still(rotation_with_up({1, 0, 0})), 5);
  EXPECT_EQ(sequence.duration_s(), 15);
  EXPECT_NEAR(force_at(sequence, 9.99).z(), 1, 1e-12);
  EXPECT_NEAR(force_at(sequence, 10).x(), 1, 1e-12);
  EXPECT_NEAR(force_at(sequence, 99).x(), 1, 1e-12);
  EXPECT_NEAR(force_at(sequence, 3).z(), 1, 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
