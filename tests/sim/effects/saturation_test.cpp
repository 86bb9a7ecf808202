#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using tests::made_block;
using tests::made_effect;

// Oracle: clipping, by hand.
TEST(Saturation, ClipsEachAxisOnBothSides) {
  const auto effect = made_effect("saturation", {{"level_g", {6}}});
  SimulatedBlock block = made_block(2);
  block.sensed_g = {{7, -7, 5.9}, {-6.1, 6, 0}};
  effect->on_analog(block);
  EXPECT_EQ(block.sensed_g[0], Eigen::Vector3d(6, -6, 5.9));
  EXPECT_EQ(block.sensed_g[1], Eigen::Vector3d(-6, 6, 0));
}

// Noise is clipped with the signal: the effect acts behind it.
TEST(Saturation, ActsOnTheNoiseToo) {
  const auto effect = made_effect("saturation", {{"level_g", {6}}});
  SimulatedBlock block = made_block(1);
  block.sensed_g[0] = {7, 0, 0};
  effect->on_sensor(block);
  EXPECT_EQ(block.sensed_g[0].x(), 7) << "noise is added after this stage";
  effect->on_analog(block);
  EXPECT_EQ(block.sensed_g[0].x(), 6);
}

// Oracle: a sine of 11 g is above 6 g in 1 - (2 / pi) asin(6 / 11) = 63.3 % of its period.
TEST(Saturation, TheShareOfAToneThatIsCut) {
  constexpr std::size_t kSamples = 100'000;
  const auto effect = made_effect("saturation", {{"level_g", {6}}});
  SimulatedBlock block = made_block(kSamples);
  for (std::size_t i = 0; i < kSamples; ++i) {
    block.sensed_g[i].x() =
        11 * std::sin(2 * std::numbers::pi * (static_cast<double>(i) + 0.5) / kSamples);
  }
  effect->on_analog(block);
  double cut = 0;
  for (const Eigen::Vector3d& sensed : block.sensed_g) {
    cut += std::abs(sensed.x()) == 6 ? 1 : 0;
  }
  EXPECT_NEAR(cut / kSamples, 1 - 2 / std::numbers::pi * std::asin(6.0 / 11), 1e-4);
}

}  // namespace
}  // namespace sixpoint::sim
