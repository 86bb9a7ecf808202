#include <cmath>
#include <cstdlib>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(Wrap, CountsOverflowModulo4096) {
  ProtocolRun run = quiet({tone(20, 3)});
  run.effects = {spec("wrap")};
  const auto wrapped = run_protocol(run);
  run.effects = {};
  run.accel_scale_lsb_per_g = 150;
  const auto whole = run_protocol(run);
  ASSERT_OK(wrapped);
  bool over = false;
  for (std::size_t i = 0; i < 1000; ++i) {
    over = over || std::abs(10 * (*whole)[i][2]) > 2047;
    const int expected = ((10 * (*whole)[i][2] + 2048) % 4096 + 4096) % 4096 - 2048;
    const int off = std::abs((*wrapped)[i][2] - expected);
    EXPECT_LE(std::min(off, 4096 - off), 6) << i;
  }
  EXPECT_TRUE(over);
}

// Oracle: 12 bits of two's complement, by hand.
TEST(Wrap, TheCountAfterTheLargestIsTheSmallest) {
  EXPECT_EQ(integer_under("wrap", 2047), 2047);
  EXPECT_EQ(integer_under("wrap", 2048), -2048);
  EXPECT_EQ(integer_under("wrap", 2047.5), -2048) << "rounded before it overflows";
  EXPECT_EQ(integer_under("wrap", -2048), -2048);
  EXPECT_EQ(integer_under("wrap", -2049), 2047);
  EXPECT_EQ(integer_under("wrap", 2816), -1280);  // 11 g at 256 LSB/g
  EXPECT_EQ(integer_under("wrap", 6144), -2048);
  EXPECT_EQ(integer_under("wrap", -6145), 2047);
  EXPECT_EQ(integer_under("tilt", 2816), 2047) << "without the effect it clips";
}

}  // namespace
}  // namespace sixpoint::sim
