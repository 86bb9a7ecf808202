#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using tests::made_block;
using tests::made_effect;

constexpr double kFloor_hz = 5;  // a quarter of a period is five samples at 100 Hz

// What is added to the specific force in the laboratory.
std::vector<Eigen::Vector3d> added(Effect& effect, double clock_start_s) {
  SimulatedBlock block = made_block(200, 100, clock_start_s);
  effect.on_stimulus(block);
  std::vector<Eigen::Vector3d> line;
  for (const MotionState& motion : block.motion) {
    EXPECT_EQ(motion.rotation, Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
    line.emplace_back(motion.force_lab_g - Eigen::Vector3d::UnitZ());
  }
  return line;
}

// Oracle: sin^2 + cos^2 = 1 whatever the phase, and all axes in step.
TEST(FloorVibration, IsASineOfItsAmplitudeAndFrequency) {
  const auto effect =
      made_effect("floor_vibration", {{"vector_mg", {2, 0, -1}}, {"frequency_hz", {kFloor_hz}}});
  const auto line = added(*effect, 30);
  for (std::size_t i = 0; i + 20 < line.size(); ++i) {
    EXPECT_NEAR(std::hypot(line[i].x(), line[i + 5].x()), 0.002, 1e-12) << i;
    EXPECT_NEAR(line[i + 20].x(), line[i].x(), 1e-12) << "a period later " << i;
    EXPECT_NEAR(line[i + 10].x(), -line[i].x(), 1e-12) << "half a period later " << i;
    EXPECT_NEAR(line[i].z(), -line[i].x() / 2, 1e-12) << i;
    EXPECT_EQ(line[i].y(), 0) << i;
  }
}

// Fixed in the laboratory: a unit that lies on its side feels it on another axis. It runs on
// between segments: 30 s are whole periods.
TEST(FloorVibration, IsFixedInTheLaboratoryAndRunsOn) {
  const auto effect =
      made_effect("floor_vibration", {{"vector_mg", {0, 0, 1}}, {"frequency_hz", {kFloor_hz}}});
  const auto now = added(*effect, 30);
  const auto later = added(*effect, 60);
  for (std::size_t i = 0; i < now.size(); ++i) {
    EXPECT_LT((now[i] - later[i]).norm(), 1e-12) << i;
  }
  const SimulatedBlock flat = tests::run(
      "floor_vibration", {{"vector_mg", {0, 0, 1}}, {"frequency_hz", {kFloor_hz}}}, {0, 0, 1});
  const SimulatedBlock side = tests::run(
      "floor_vibration", {{"vector_mg", {0, 0, 1}}, {"frequency_hz", {kFloor_hz}}}, {1, 0, 0});
  for (std::size_t i = 0; i + 5 < flat.size(); ++i) {
    EXPECT_NEAR(std::hypot(flat.true_g[i].z() - 1, flat.true_g[i + 5].z() - 1), 0.001, 1e-12);
    EXPECT_NEAR(side.true_g[i].x(), flat.true_g[i].z(), 1e-12) << i;
    EXPECT_NEAR(side.true_g[i].z(), 0, 1e-12) << i;
  }
}

}  // namespace
}  // namespace sixpoint::sim
