#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

// Oracle: closed forms.
TEST(ClockError, ClockErrorComesEarly) {
  const SimulatedBlock block = run("clock_error", {{"ppm", {1000}}}, {0, 0, 1});
  EXPECT_NEAR(block.time_s[100], 1 / 1.001, 1e-12);
}

// Oracle: a clock that is slow by e takes 1 / (1 - e) of the true time; it counts from its own
// start, not from power-on.
TEST(ClockError, ASlowClockComesLateFromItsOwnStart) {
  const auto effect = made_effect("clock_error", {{"ppm", {-5000}}});
  SimulatedBlock block = made_block(1001, 100, 600);
  effect->on_sampling(block);
  EXPECT_DOUBLE_EQ(block.time_s[0], 600);
  EXPECT_NEAR(block.time_s[1000], 600 + 10 / 0.995, 1e-9);
}

}  // namespace
}  // namespace sixpoint::sim
