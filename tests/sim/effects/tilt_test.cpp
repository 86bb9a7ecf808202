#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using tests::run;

// Oracle: closed forms.
TEST(Tilt, TiltTurnsGravityInTheLaboratory) {
  // What acts is turned by +1 degree about lab x: up leans towards -y.
  const SimulatedBlock block = run("tilt", {{"rotation_vector_deg", {1, 0, 0}}}, {0, 0, 1});
  const double angle = std::acos(-1.0) / 180;
  EXPECT_NEAR(block.true_g[0].y(), -std::sin(angle), 1e-12);
  EXPECT_NEAR(block.true_g[0].z(), std::cos(angle), 1e-12);
}

// Oracle: the rotation of the laboratory's vertical by hand: T (0, 0, 1) = (0, -sin, cos), which
// the pose then maps into the sensor's frame. A unit turned half around z reads the opposite sign,
// which misalignment would not.
TEST(Tilt, IsFixedInTheLaboratory) {
  const auto effect = tests::made_effect("tilt", {{"rotation_vector_deg", {1, 0, 0}}});
  const double angle = std::numbers::pi / 180;
  SimulatedBlock block = tests::made_block(3);
  block.motion[1].rotation = Eigen::Vector3d(-1, -1, 1).asDiagonal();  // half around z
  block.motion[2].rotation << 0, 0, 1, 1, 0, 0, 0, 1, 0;               // x up, z along the lab's y
  effect->on_stimulus(block);
  const auto felt_g = [&](std::size_t i) -> Eigen::Vector3d {
    return block.motion[i].rotation * block.motion[i].force_lab_g;
  };
  EXPECT_LT((felt_g(0) - Eigen::Vector3d(0, -std::sin(angle), std::cos(angle))).norm(), 1e-12);
  EXPECT_LT((felt_g(1) - Eigen::Vector3d(0, std::sin(angle), std::cos(angle))).norm(), 1e-12);
  EXPECT_LT((felt_g(2) - Eigen::Vector3d(std::cos(angle), 0, -std::sin(angle))).norm(), 1e-12);
}

// Oracle: with an angle, the vector says the direction only.
TEST(Tilt, AnAngleReplacesTheLengthOfTheVector) {
  const SimulatedBlock block =
      run("tilt", {{"rotation_vector_deg", {0, 0.2, 0}}, {"angle_deg", {3}}}, {0, 0, 1});
  EXPECT_NEAR(block.true_g[0].x(), std::sin(3 * std::numbers::pi / 180), 1e-12);
  EXPECT_NEAR(block.true_g[0].z(), std::cos(3 * std::numbers::pi / 180), 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
