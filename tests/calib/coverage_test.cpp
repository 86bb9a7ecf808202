#include "calib/coverage.h"

#include <cmath>

#include <gtest/gtest.h>

#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

TEST(Coverage, NineSubsetsAndTheThirtyPercentRule) {
  EXPECT_EQ(value_subset(1.0), ValueSubset::high);
  EXPECT_EQ(value_subset(0.69), ValueSubset::middle);
  EXPECT_EQ(value_subset(-0.7), ValueSubset::low);
  EXPECT_EQ(value_subset(1.31), ValueSubset::outside);
  EXPECT_EQ(value_subset(std::nan("")), ValueSubset::outside);
  std::vector<PerAxis<double>> means = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}};
  Coverage coverage = coverage_of(means);
  EXPECT_EQ(coverage.missing_directions(), std::vector<std::string>{"-z"});
  EXPECT_EQ(coverage.subset_blocks[0][0], 1U);
  EXPECT_EQ(coverage.subset_blocks[0][1], 3U);
  means.push_back({0.95, 0, -0.3});
  EXPECT_FALSE(coverage_of(means).complete());
  means.push_back({0.95, 0, -0.301});
  EXPECT_TRUE(coverage_of(means).complete());
  const std::vector<std::string> all = {"+x", "-x", "+y", "-y", "+z", "-z"};
  EXPECT_EQ(coverage_of(std::span<const PerAxis<double>>{}).missing_directions(), all);
}

// The nine subsets' bounds (paper, Step 2).
TEST(Coverage, BoundsOfTheSubsets) {
  for (const auto& [value_g, expected] : {std::pair{1.31, ValueSubset::outside},
                                          {1.3, ValueSubset::high},
                                          {0.7, ValueSubset::high},
                                          {0.69, ValueSubset::middle},
                                          {-0.69, ValueSubset::middle},
                                          {-0.7, ValueSubset::low},
                                          {-1.3, ValueSubset::low},
                                          {-1.31, ValueSubset::outside}}) {
    EXPECT_EQ(value_subset(value_g), expected) << value_g;
  }
}

// The limit itself is not enough; other constants may say otherwise.
TEST(Coverage, BeyondTheLimitByTheConstantsThatAreAsked) {
  const tests::SyntheticUnit unit;
  auto directions = tests::kSixSides;
  directions[5] = {std::sqrt(1 - 0.31 * 0.31), 0, -0.31};
  const auto blocks = tests::exact_blocks(unit, directions);
  EXPECT_TRUE(coverage_of(blocks, tests::truth(unit)).complete());
  Calibration shifted = tests::truth(unit);
  shifted.zero_lsb[2] -= 0.02 * unit.counts_per_g[2];  // -0.31 g now reads -0.29 g
  EXPECT_EQ(coverage_of(blocks, shifted).missing_directions(), std::vector<std::string>{"-z"});
}

}  // namespace
}  // namespace sixpoint::calib
