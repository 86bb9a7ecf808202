#include <cmath>
#include <cstdlib>
#include <memory>
#include <vector>

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

// Of a unit in free motion. Oracle: what acts, in counts, modulo 4096.
TEST(Wrap, ARecordingOverflowsAsABundleDoes) {
  const auto motion = shaker(Eigen::Matrix3d::Identity(), {Eigen::Vector3d(0, 0, 1), 2, 11, 0});
  std::vector<std::unique_ptr<Effect>> effects;
  effects.push_back(made_effect("wrap"));
  Simulator simulator(unit_of_256_lsb_per_g(), {}, *motion, std::move(effects));
  SimulatedBlock block;
  simulator.next(600, block);
  std::size_t over = 0;
  for (std::size_t i = 0; i < block.size(); ++i) {
    const auto lsb = static_cast<int>(std::lround(256 * block.true_g[i].z()));
    over += lsb < -2048 || lsb > 2047 ? 1 : 0;
    EXPECT_EQ(block.stored[i][2], ((lsb + 2048) % 4096 + 4096) % 4096 - 2048) << i;
  }
  EXPECT_GT(over, 100U);
  EXPECT_EQ(simulator.clipped(), 0U);
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
