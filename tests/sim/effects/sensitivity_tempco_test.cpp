#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using tests::made_effect;
using tests::sensed_under;

// Oracle: 0.05 %/C, the ADXL362 datasheet's typical value, over 20 C is one percent.
TEST(SensitivityTempco, OnePercentOverTwentyDegrees) {
  const auto effect = made_effect("sensitivity_tempco", {{"percent_per_c", {0.05, 0.05, 0.05}}});
  EXPECT_NEAR(sensed_under(*effect, {0, 0, 1}, 45).z(), 1.01, 1e-12);
  EXPECT_NEAR(sensed_under(*effect, {0, 0, -4}, 45).z(), -4.04, 1e-12);
  EXPECT_NEAR(sensed_under(*effect, {0, 0, 1}, 5).z(), 0.99, 1e-12);
}

// Oracle: a factor. At 25 C it is one; the zero does not move at any temperature.
TEST(SensitivityTempco, EachAxisHasItsOwnAndTheZeroStays) {
  const auto effect = made_effect("sensitivity_tempco", {{"percent_per_c", {0.02, -0.04, 0}}});
  const Eigen::Vector3d force_g(2, -1, 1);
  EXPECT_LT((sensed_under(*effect, force_g, 25) - force_g).norm(), 1e-12);
  EXPECT_EQ(sensed_under(*effect, {0, 0, 0}, 40), Eigen::Vector3d(0, 0, 0));
  const Eigen::Vector3d warm = sensed_under(*effect, force_g, 35);
  EXPECT_LT((warm - Eigen::Vector3d(2.004, -0.996, 1)).norm(), 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
