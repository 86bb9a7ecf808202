#include <vector>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

// Oracle: what firmware 1.6.0 does (16CPAN03): x stored = -y, y stored = x.
TEST(AxisRotation, TurnsWhatIsStoredAsFirmware160Does) {
  const auto effect = made_effect("axis_rotation");
  SimulatedBlock block = made_block(2);
  block.stored = {{10, 20, 30}, {-400, 300, -256}};
  effect->on_firmware(block);
  EXPECT_EQ(block.stored, (std::vector<gt3x::Counts>{{-20, 10, 30}, {-300, -400, -256}}));
}

// Oracle: half a turn about x, by hand.
TEST(AxisRotation, TheMatrixHasOneRowForEachStoredAxis) {
  const auto effect = made_effect("axis_rotation", {{"matrix", {1, 0, 0, 0, -1, 0, 0, 0, -1}}});
  SimulatedBlock block = made_block(1);
  block.stored = {{10, 20, 30}};
  effect->on_firmware(block);
  EXPECT_EQ(block.stored[0], (gt3x::Counts{10, -20, -30}));
}

// Oracle: 12 bits of two's complement, where -2048 has no opposite.
TEST(AxisRotation, AReversedLimitIsClipped) {
  const auto effect = made_effect("axis_rotation");
  SimulatedBlock block = made_block(1);
  block.stored = {{-2048, -2048, 2047}};
  effect->on_firmware(block);
  EXPECT_EQ(block.stored[0], (gt3x::Counts{2047, -2048, 2047}));
}

TEST(AxisRotation, NeitherTheTruthNorTheSensorIsTurned) {
  const SimulatedBlock turned = run("axis_rotation", {}, {0.6, -0.8, 0});
  const SimulatedBlock straight = run("tilt", {{"rotation_vector_deg", {0, 0, 0}}}, {0.6, -0.8, 0});
  EXPECT_NEAR(turned.true_g[0].x(), 0.6, 1e-12);
  EXPECT_NEAR(turned.sensed_g[0].y(), -0.8, 1e-12);
  EXPECT_EQ(turned.stored[0][0], -straight.stored[0][1]);
  EXPECT_EQ(turned.stored[0][1], straight.stored[0][0]);
  EXPECT_GT(straight.stored[0][0], 100);
}

}  // namespace
}  // namespace sixpoint::sim
