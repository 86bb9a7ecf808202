#include "calib/genetic.h"

#include <limits>

#include <gtest/gtest.h>

#include "calib/least_squares.h"
#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using tests::SyntheticUnit;

// A sensor that reads 10 % low with offsets of 0.1 g, as under the other filter.
SyntheticUnit mismatched() {
  SyntheticUnit unit;
  unit.positive = {250, 250, 250};
  unit.negative = {-250, -250, -250};
  unit.zero = {0, 0, 0};
  unit.counts_per_g = {225, 228, 222};
  unit.zero_counts = {25, -25, 30};
  return unit;
}

TEST(Genetic, FindsTheConstantsThatMadeTheBlocks) {
  const SyntheticUnit unit = mismatched();
  const auto blocks = tests::exact_blocks(unit, tests::cube_directions(), 10);
  const auto found = genetic(blocks, tests::file_constants(unit));
  ASSERT_OK(found);
  EXPECT_TRUE(found->settled);
  EXPECT_EQ(found->fitness_mg.size(), 16U);  // the paper's recursions
  EXPECT_LT(found->level_mg, 2);
  EXPECT_LT(difference_over_sphere(tests::truth(unit), found->calibration).worst_mg, 5);
}

TEST(Genetic, TheSameSeedGivesTheSameAnswer) {
  const SyntheticUnit unit = mismatched();
  const auto blocks = tests::exact_blocks(unit, tests::cube_directions(), 10);
  GeneticOptions options;
  options.seed = 7;
  const auto first = genetic(blocks, tests::file_constants(unit), options);
  const auto second = genetic(blocks, tests::file_constants(unit), options);
  options.seed = 8;
  const auto other = genetic(blocks, tests::file_constants(unit), options);
  ASSERT_OK(first);
  ASSERT_OK(second);
  ASSERT_OK(other);
  EXPECT_EQ(first->calibration, second->calibration);
  EXPECT_EQ(first->fitness_mg, second->fitness_mg);
  EXPECT_NE(first->fitness_mg, other->fitness_mg);
}

// The file's own constants are a member of the first population, so a file that needs nothing is
// never made worse.
TEST(Genetic, RightConstantsStay) {
  SyntheticUnit unit;
  unit.counts_per_g = {255, 255, 255};
  unit.zero_counts = {45, 35, 25};
  const auto blocks = tests::exact_blocks(unit, tests::cube_directions(), 10);
  const auto found = genetic(blocks, tests::file_constants(unit));
  ASSERT_OK(found);
  EXPECT_LT(found->level_mg, 1e-2);
  EXPECT_LT(difference_over_sphere(tests::truth(unit), found->calibration).worst_mg, 0.1);
}

TEST(Genetic, RefusesWhatCannotBeSearched) {
  const SyntheticUnit unit;
  const Calibration file = tests::file_constants(unit);
  EXPECT_FAILS(genetic({}, file), ErrorCode::bad_data);
  auto blocks = tests::exact_blocks(unit, tests::kSixSides);
  blocks[0].mean_lsb[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FAILS(genetic(blocks, file), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::calib
