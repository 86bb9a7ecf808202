#include "calib/temperature_drift.h"

#include <gtest/gtest.h>

#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using tests::SyntheticUnit;

// A unit that lies still while the temperature rises by `range_c`, its zeros by mg_per_c.
std::vector<StillBlock> warming(const tests::Vector& up, double from_c, double range_c,
                                const PerAxis<double>& mg_per_c) {
  std::vector<StillBlock> blocks;
  constexpr int kBlocks = 101;
  for (int i = 0; i < kBlocks; ++i) {
    const double above_c = range_c * i / (kBlocks - 1);
    tests::Vector g = up;
    for (std::size_t a = 0; a < kAxes; ++a) {
      g[a] += mg_per_c[a] / 1000 * (from_c + above_c - 20);
    }
    blocks.push_back(tests::exact_block({}, g, 4.0 * i));
    blocks.back().temperature_c = from_c + above_c;
  }
  return blocks;
}

constexpr PerAxis<double> kSlopes = {0.4, -0.3, 0.6};

TEST(TemperatureDrift, AStraightLineIsFoundExactly) {
  const auto drift =
      temperature_drift(warming({0, 0, 1}, 20, 10, kSlopes), tests::truth(SyntheticUnit()));
  ASSERT_TRUE(drift);
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_NEAR(drift->zero_mg_per_c[a], kSlopes[a], 1e-9);
    EXPECT_NEAR(drift->standard_uncertainty_mg_per_c[a], 0, 1e-6);
  }
  EXPECT_EQ(drift->stretches, 1);
  EXPECT_EQ(drift->blocks, 101U);
}

// Two poses have two levels and one slope.
TEST(TemperatureDrift, EachPoseKeepsItsOwnLevel) {
  auto blocks = warming({0, 0, 1}, 20, 10, kSlopes);
  const auto second = warming({1, 0, 0}, 5, 8, kSlopes);
  blocks.insert(blocks.end(), second.begin(), second.end());
  const auto drift = temperature_drift(blocks, tests::truth(SyntheticUnit()));
  ASSERT_TRUE(drift);
  EXPECT_EQ(drift->stretches, 2);
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_NEAR(drift->zero_mg_per_c[a], kSlopes[a], 1e-9);
  }
  EXPECT_LT(drift->low_c, 6.1);
  EXPECT_GT(drift->high_c, 28.9);
}

TEST(TemperatureDrift, TooLittleWarmingIsNoAnswer) {
  const Calibration constants = tests::truth(SyntheticUnit());
  EXPECT_FALSE(temperature_drift(warming({0, 0, 1}, 20, 2, kSlopes), constants));
  EXPECT_FALSE(temperature_drift(tests::exact_blocks({}, tests::kSixSides, 20), constants));
  EXPECT_FALSE(temperature_drift({}, constants));
}

}  // namespace
}  // namespace sixpoint::calib
