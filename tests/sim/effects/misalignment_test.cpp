#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(Misalignment, MisalignmentTurnsWhatTheSensorFeelsNotTheTruth) {
  const SimulatedBlock block = run("misalignment", {{"rotation_vector_deg", {0, 1, 0}}}, {0, 0, 1});
  EXPECT_NEAR(block.true_g[0].x(), 0, 1e-12);
  EXPECT_NEAR(std::abs(block.sensed_g[0].x()), std::sin(std::acos(-1.0) / 180), 1e-12);
}

// Oracle: a right-handed rotation of the specific force by hand: about +y it takes z towards x,
// about +x it takes z towards -y (docs/scenario.md: f becomes T f).
TEST(Misalignment, TheForceTurnsByTheRightHand) {
  const double degree = std::numbers::pi / 180;
  const auto about_y = made_effect("misalignment", {{"rotation_vector_deg", {0, 1, 0}}});
  EXPECT_LT(
      (sensed_under(*about_y, {0, 0, 1}) - Eigen::Vector3d(std::sin(degree), 0, std::cos(degree)))
          .norm(),
      1e-12);
  const auto about_x = made_effect("misalignment", {{"rotation_vector_deg", {0.5, 0, 0}}});
  EXPECT_LT((sensed_under(*about_x, {0, 0, 1}) -
             Eigen::Vector3d(0, -std::sin(degree / 2), std::cos(degree / 2)))
                .norm(),
            1e-12);
  EXPECT_LT((sensed_under(*about_x, {1, 0, 0}) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
}

// A rotation keeps lengths and angles; non_orthogonality does not.
TEST(Misalignment, LengthsAndAnglesStay) {
  const auto effect = made_effect("misalignment", {{"rotation_vector_deg", {0.7, -0.4, 0.9}}});
  const Eigen::Vector3d a = sensed_under(*effect, {0.6, 0, 0.8});
  const Eigen::Vector3d b = sensed_under(*effect, {0.8, 0, -0.6});
  EXPECT_NEAR(a.norm(), 1, 1e-12);
  EXPECT_NEAR(a.dot(b), 0, 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
