// When blocks that fail the paper's criteria by noise alone are used after all (solve.h).
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/made_blocks.h"
#include "calib/solve.h"
#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using tests::SyntheticUnit;
using tests::Vector;

// Good blocks in many directions that are too noisy for the paper's second criterion.
void add_noisy(std::vector<StillBlock>& blocks, const SyntheticUnit& unit) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 300; ++i) {
    blocks.push_back(
        tests::exact_block(unit, tests::random_direction(random), blocks.back().start_time_s + 4));
    blocks.back().noisy = true;
  }
}

SolveReport solved(const std::vector<StillBlock>& blocks, const SyntheticUnit& unit) {
  auto report = solve_from_still_blocks(blocks, tests::file_constants(unit));
  EXPECT_OK(report);
  return *std::move(report);
}

TEST(NoisyRetry, AfterAMissingSide) {
  const SyntheticUnit unit = tests::mismatched(4);
  std::vector<Vector> sides = tests::kSixSides;
  sides.pop_back();
  auto blocks = tests::exact_blocks(unit, sides, 15);
  EXPECT_EQ(solved(blocks, unit).verification.verdict, Verdict::incomplete);
  add_noisy(blocks, unit);
  const SolveReport report = solved(blocks, unit);
  EXPECT_TRUE(report.usable()) << report.brief();
  EXPECT_EQ(report.noisy_points, 300U);
}

TEST(NoisyRetry, AfterSidesWithTooFewBlocks) {
  const SyntheticUnit unit = tests::mismatched(4);
  auto blocks = tests::exact_blocks(unit, tests::kSixSides, 1);
  add_noisy(blocks, unit);
  EXPECT_EQ(solved(blocks, unit).noisy_points, 300U);
}

TEST(NoisyRetry, NeverAfterBlocksThatContradictTheConstants) {
  const SyntheticUnit unit = tests::mismatched(4);
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> wrong(0.97, 1.03);
  std::vector<StillBlock> blocks;
  for (const Vector& up : tests::cube_directions()) {
    Vector g = up;
    const double length = wrong(random);
    for (double& value : g) {
      value *= length;
    }
    for (int i = 0; i < 5; ++i) {
      blocks.push_back(tests::exact_block(unit, g, 4.0 * static_cast<double>(blocks.size())));
    }
  }
  add_noisy(blocks, unit);
  const SolveReport report = solved(blocks, unit);
  EXPECT_FALSE(report.usable()) << report.brief();
  EXPECT_TRUE(report.verification.contradicted);
  EXPECT_EQ(report.noisy_points, 0U);
}

TEST(NoisyRetry, NeverAfterADriftOfTheZeros) {
  SyntheticUnit unit = tests::mismatched(4);
  unit.drift_mg_per_c = {0.6, 0.5, -0.7};
  std::vector<StillBlock> blocks;
  // Six sides of two minutes, the unit warmer by 20 C at the end.
  for (const Vector& up : tests::kSixSides) {
    for (int i = 0; i < 30; ++i) {
      const double warmth_c = static_cast<double>(blocks.size()) * 20 / 180;
      Vector g = up;
      for (std::size_t a = 0; a < 3; ++a) {
        g[a] += unit.drift_mg_per_c[a] * warmth_c / 1000;
      }
      blocks.push_back(tests::exact_block(unit, g, 4.0 * static_cast<double>(blocks.size())));
    }
  }
  add_noisy(blocks, unit);
  const SolveReport report = solved(blocks, unit);
  EXPECT_FALSE(report.usable()) << report.brief();
  EXPECT_THAT(report.verification.reasons, testing::Contains(testing::HasSubstr("drift")));
  EXPECT_TRUE(report.verification.contradicted);
  EXPECT_EQ(report.noisy_points, 0U);
}

}  // namespace
}  // namespace sixpoint::calib
