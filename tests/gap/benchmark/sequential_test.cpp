#include "gap/benchmark/sequential.h"

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

TEST(Sequential, NothingWhereNothingIs) {
  int alarms = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    tests::MadeUnit unit;
    unit.seed = seed;
    const Answer answer = answer_by_regression(tests::made_production(unit), "b1");
    EXPECT_EQ(answer.bundle, "b1");
    EXPECT_FALSE(answer.unknown);
    alarms += answer.effects.empty() ? 0 : 1;
  }
  EXPECT_LE(alarms, 2);
}

// The case is turned against the sensor by 9 mrad about its Z axis.
TEST(Sequential, NamesASkewedSensor) {
  const auto skewed = [](const Segment& segment, double) {
    const Eigen::Vector3d pose = segment.rotation.col(2);
    return Eigen::Vector3d(pose + 0.009 * Eigen::Vector3d::UnitZ().cross(pose));
  };
  const Answer answer = answer_by_regression(tests::made_production({}, skewed), "b1");
  ASSERT_FALSE(answer.effects.empty());
  EXPECT_EQ(answer.effects.front().first, "misalignment");
  EXPECT_GT(answer.effects.front().second, 0.99);
  EXPECT_FALSE(answer.unknown);
}

// Y reads 8 mg more in every other dwell: no effect that it knows, in each part of the protocol.
TEST(Sequential, SaysUnknownWhereNoRegressorFits) {
  const auto odd = [](const Segment& segment, double) {
    const double more_g = (segment.placement * segment.placement) % 7 < 3 ? 0.008 : 0;
    return Eigen::Vector3d(segment.rotation.col(2) + more_g * Eigen::Vector3d::UnitY());
  };
  const Answer answer = answer_by_regression(tests::made_production({}, odd), "b1");
  EXPECT_TRUE(answer.unknown);
  EXPECT_GT(answer.unknown_probability, 0.9);
  ASSERT_TRUE(answer.where);
  EXPECT_TRUE(answer.where->contains({1, "faces"}));
  EXPECT_FALSE(answer.where->contains({2, "faces"}));
}

}  // namespace
}  // namespace sixpoint::gap
