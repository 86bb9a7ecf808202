#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

// Oracle: a ratio of specific forces; gravity is vertical.
TEST(LocalGravity, ChangesTheVerticalForceOnly) {
  const auto effect = made_effect("local_gravity", {{"ratio", {0.998}}});
  SimulatedBlock block = made_block(2);
  block.motion[1].force_lab_g = {0.3, -0.2, 1.5};  // shaken
  effect->on_stimulus(block);
  EXPECT_NEAR(block.motion[0].force_lab_g.z(), 0.998, 1e-12);
  EXPECT_LT((block.motion[1].force_lab_g - Eigen::Vector3d(0.3, -0.2, 1.498)).norm(), 1e-12);
}

TEST(LocalGravity, IsTheSameInEveryPose) {
  for (const Eigen::Vector3d& up :
       {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(0.6, 0, 0.8)}) {
    const SimulatedBlock block = run("local_gravity", {{"ratio", {1.0015}}}, up);
    EXPECT_LT((block.true_g[0] - 1.0015 * up).norm(), 1e-12);
  }
}

// Oracle: normal gravity of WGS 84 at the equator and at the poles, over the standard 9.80665 m/s2.
TEST(LocalGravity, ThePlausibleRangeIsThatOfTheEarth) {
  const EffectKind& kind = **find_effect("local_gravity");
  EXPECT_NEAR(kind.parameters[0].low, 9.7803253359 / 9.80665, 1e-4);
  EXPECT_NEAR(kind.parameters[0].high, 9.8321849378 / 9.80665, 1e-4);
}

}  // namespace
}  // namespace sixpoint::sim
