#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

// Oracle: closed forms.
TEST(SecondOrder, IsTheSameOnBothSides) {
  EXPECT_NEAR(run("second_order", {{"mg_per_g2", {0.5, 0.5, 0.5}}}, {0, 0, -1}).sensed_g[0].z(),
              -1 + 0.0005, 1e-12);
}

// Oracle: a + K2 a^2 of each axis, by hand.
TEST(SecondOrder, GrowsWithTheSquare) {
  const auto effect = made_effect("second_order", {{"mg_per_g2", {0.5, -0.2, 0}}});
  const Eigen::Vector3d sensed = sensed_under(*effect, {4, -3, 6});
  EXPECT_NEAR(sensed.x(), 4.008, 1e-12);    // 0.5 mg/g2 times 16 g2
  EXPECT_NEAR(sensed.y(), -3.0018, 1e-12);  // -0.2 mg/g2 times 9 g2
  EXPECT_NEAR(sensed.z(), 6, 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
