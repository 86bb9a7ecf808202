#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using tests::made_block;
using tests::made_effect;

constexpr double kLine_hz = 5;  // a quarter of a period is five samples at 100 Hz

std::vector<Eigen::Vector3d> added(Effect& effect, double clock_start_s,
                                   const Eigen::Vector3d& force_g) {
  SimulatedBlock block = made_block(200, 100, clock_start_s);
  block.sensed_g.assign(block.size(), force_g);
  effect.on_sensor(block);
  for (Eigen::Vector3d& sensed : block.sensed_g) {
    sensed -= force_g;
  }
  return block.sensed_g;
}

// Oracle: sin^2 + cos^2 = 1 whatever the phase, and all axes in step.
TEST(ElectricalLine, IsASineOfItsAmplitudeAndFrequency) {
  const auto effect =
      made_effect("electrical_line", {{"vector_mg", {1, -2, 0}}, {"frequency_hz", {kLine_hz}}});
  const auto line = added(*effect, 30, {0, 0, 1});
  for (std::size_t i = 0; i + 20 < line.size(); ++i) {
    EXPECT_NEAR(std::hypot(line[i].x(), line[i + 5].x()), 0.001, 1e-12) << i;
    EXPECT_NEAR(line[i + 20].x(), line[i].x(), 1e-12) << "a period later " << i;
    EXPECT_NEAR(line[i + 10].x(), -line[i].x(), 1e-12) << "half a period later " << i;
    EXPECT_NEAR(line[i].y(), -2 * line[i].x(), 1e-12) << i;
    EXPECT_EQ(line[i].z(), 0) << i;
  }
}

// Fixed in the sensor's frame: the pose does not matter. It runs on between segments: 30 s are
// whole periods.
TEST(ElectricalLine, IsTheSameInEveryPoseAndRunsOn) {
  const auto effect =
      made_effect("electrical_line", {{"vector_mg", {1, 2, 3}}, {"frequency_hz", {kLine_hz}}});
  const auto flat = added(*effect, 30, {0, 0, 1});
  const auto side = added(*effect, 60, {1, 0, 0});
  for (std::size_t i = 0; i < flat.size(); ++i) {
    EXPECT_LT((flat[i] - side[i]).norm(), 1e-12) << i;
  }
}

TEST(ElectricalLine, ThePhaseIsDrawn) {
  const auto first = made_effect("electrical_line", {}, 1);
  const auto other = made_effect("electrical_line", {}, 2);
  EXPECT_GT((added(*first, 0, {0, 0, 1})[0] - added(*other, 0, {0, 0, 1})[0]).norm(), 1e-6);
}

}  // namespace
}  // namespace sixpoint::sim
