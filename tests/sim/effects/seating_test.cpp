#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using tests::made_block;
using tests::made_effect;

Eigen::Matrix3d seated(Effect& effect, bool anew) {
  Placement placement;
  placement.anew = anew;
  effect.on_placement(placement);
  SimulatedBlock block = made_block(2);
  effect.on_stimulus(block);
  EXPECT_EQ(block.motion[0].rotation, block.motion[1].rotation) << "one placement, one seat";
  EXPECT_EQ(block.motion[0].force_lab_g, Eigen::Vector3d(0, 0, 1));
  return block.motion[0].rotation;
}

// Oracle: a small rotation by a Gaussian vector of sd_deg per axis. Level with z up, x and y then
// read sd_deg pi / 180 in g; the squared angle has a mean of 3 sd_deg^2. Limits of five standard
// errors.
TEST(Seating, EveryPlacementTurnsByItsOwnSmallAngle) {
  constexpr int kPlacements = 4000;
  const double n = kPlacements;
  const auto effect = made_effect("seating", {{"sd_deg", {0.2}}});
  const double sd_g = 0.2 * std::numbers::pi / 180;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d square = Eigen::Vector3d::Zero();
  double angle2_deg2 = 0;
  for (int i = 0; i < kPlacements; ++i) {
    const Eigen::Matrix3d turn = seated(*effect, true);
    EXPECT_LT((turn * turn.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    const Eigen::Vector3d felt_g = turn * Eigen::Vector3d::UnitZ();
    mean += felt_g / n;
    square += felt_g.cwiseAbs2() / n;
    angle2_deg2 += std::pow(Eigen::AngleAxisd(turn).angle() * 180 / std::numbers::pi, 2) / n;
  }
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    EXPECT_NEAR(mean[axis], 0, 5 * sd_g / std::sqrt(n));
    EXPECT_NEAR(square[axis] / (sd_g * sd_g), 1, 5 * std::sqrt(2 / n));
  }
  EXPECT_NEAR(angle2_deg2 / (3 * 0.2 * 0.2), 1, 5 * std::sqrt(2 / (3 * n)));
}

TEST(Seating, TheUnitKeepsItsSeatUntilItIsTakenOff) {
  const auto effect = made_effect("seating");
  const Eigen::Matrix3d first = seated(*effect, true);
  EXPECT_EQ(seated(*effect, false), first);
  EXPECT_NE(seated(*effect, true), first);
}

// The seat turns the unit in its own frame: on its side it reads the error on the other axes.
TEST(Seating, TheErrorIsInTheFrameOfTheUnit) {
  const auto effect = made_effect("seating", {{"sd_deg", {0.5}}});
  const Eigen::Matrix3d turn = seated(*effect, true);
  SimulatedBlock block = made_block(1);
  block.motion[0].rotation << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // x up
  effect->on_stimulus(block);
  const Eigen::Vector3d felt_g = block.motion[0].rotation * Eigen::Vector3d::UnitZ();
  EXPECT_LT((felt_g - turn.col(0)).norm(), 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
