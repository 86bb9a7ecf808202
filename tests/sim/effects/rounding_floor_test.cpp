#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(RoundingFloor, StoresTheNextLowerCount) {
  ProtocolRun run = quiet({at_rest(up(2), 0, 50)});
  run.accel_scale_lsb_per_g = 256;
  run.offset_g = {-0.7 / 256, 0.7 / 256, 0};
  run.effects = {spec("rounding_floor")};
  EXPECT_EQ((*run_protocol(run))[0], (gt3x::Counts{-1, 0, 256}));
}

// Oracle: the greatest whole number that is not greater, by hand.
TEST(RoundingFloor, RoundsDownwardOnBothSidesOfZero) {
  EXPECT_EQ(integer_under("rounding_floor", 0.9), 0);
  EXPECT_EQ(integer_under("rounding_floor", 5), 5);
  EXPECT_EQ(integer_under("rounding_floor", -0.1), -1);
  EXPECT_EQ(integer_under("rounding_floor", -2.9), -3);
  EXPECT_EQ(integer_under("rounding_floor", 2047.9), 2047);
  EXPECT_EQ(integer_under("rounding_floor", -2047.1), -2048);
}

// Oracle: half an LSB too low on average over evenly spread values; rounding to the nearest has no
// such bias.
TEST(RoundingFloor, ReadsHalfALsbTooLow) {
  double bias_lsb = 0;
  constexpr int kValues = 6400;
  for (int i = 0; i < kValues; ++i) {
    const double value_lsb = (i + 0.5) / 64 - 50;
    bias_lsb += (integer_under("rounding_floor", value_lsb) - value_lsb) / kValues;
  }
  EXPECT_NEAR(bias_lsb, -0.5, 1e-9);
}

}  // namespace
}  // namespace sixpoint::sim
