#include <cstdint>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(ChargingZeros, ChargingStoresZeros) {
  const SimulatedBlock block =
      run("charging_zeros", {{"start_s", {0.5}}, {"seconds", {1}}}, {0, 0, 1});
  EXPECT_NE(block.stored[49], (gt3x::Counts{}));
  EXPECT_EQ(block.stored[50], (gt3x::Counts{}));
  EXPECT_EQ(block.stored[149], (gt3x::Counts{}));
  EXPECT_NE(block.stored[150], (gt3x::Counts{}));
}

// Oracle: the catalogue's definition, runs of whole seconds of zero on all axes; 60 s of 10 minutes
// at 100 Hz are 6000 samples.
TEST(ChargingZeros, DrawnRunsHoldTheSecondsThatWereAskedFor) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto effect = made_effect("charging_zeros", {{"seconds", {60}}}, seed);
    RecordingPlan plan;
    plan.rate_hz = 100;
    plan.samples = 60'000;
    effect->on_recording(plan);
    SimulatedBlock block = made_block(60'000);
    effect->on_firmware(block);
    std::size_t zeros = 0;
    std::size_t runs = 0;
    for (std::size_t i = 0; i < block.size(); ++i) {
      const bool zero = block.stored[i] == gt3x::Counts{};
      const bool before = i > 0 && block.stored[i - 1] == gt3x::Counts{};
      zeros += zero ? 1 : 0;
      runs += zero && !before ? 1 : 0;
      EXPECT_TRUE(zero == before || i % 100 == 0) << "a run begins and ends with a second: " << i;
    }
    EXPECT_EQ(zeros, 6000U) << seed;
    EXPECT_GE(runs, 3U) << seed;
    EXPECT_LE(runs, 5U) << seed;
  }
}

TEST(ChargingZeros, WhatTheSensorHadIsNotTouched) {
  const SimulatedBlock block =
      run("charging_zeros", {{"start_s", {0}}, {"seconds", {1}}}, {0, 0, 1});
  EXPECT_NEAR(block.sensed_g[50].z(), 1, 1e-12);
  EXPECT_GT(block.raw_lsb[50][2], 100);
}

}  // namespace
}  // namespace sixpoint::sim
