#include "calib/block_fit.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using tests::SyntheticUnit;

TEST(BlockFit, ExactBlocksGiveTheExactConstants) {
  const SyntheticUnit unit;
  const auto fit = fit_blocks(tests::exact_blocks(unit, tests::cube_directions(), 5),
                              tests::file_constants(unit));
  ASSERT_OK(fit);
  EXPECT_EQ(fit->directions, 26);
  EXPECT_EQ(fit->redundancy, 20);
  EXPECT_EQ(fit->blocks_used, 130U);
  EXPECT_EQ(fit->blocks_left_out, 0U);
  EXPECT_LT(fit->rms_mg, 1e-6);
  ASSERT_TRUE(fit->held_out_rms_mg);
  EXPECT_LT(*fit->held_out_rms_mg, 1e-4);
  EXPECT_LT(difference_over_sphere(tests::truth(unit), fit->best().calibration).worst_mg, 1e-5);
}

// Magnitudes alternately 1 mg too large and too small: in each cell of ten blocks the squares add
// up to 10 mg^2 about the mean, for 9 degrees of freedom.
TEST(BlockFit, ScatterWithinTheDirections) {
  const SyntheticUnit unit;
  std::vector<StillBlock> blocks;
  for (const tests::Vector& n : tests::cube_directions()) {
    for (int i = 0; i < 10; ++i) {
      const double length = 1 + (i % 2 == 0 ? 0.001 : -0.001);
      blocks.push_back(tests::exact_block(unit, {length * n[0], length * n[1], length * n[2]}));
    }
  }
  const auto fit = fit_blocks(blocks, tests::file_constants(unit));
  ASSERT_OK(fit);
  EXPECT_NEAR(fit->block_sd_mg, std::sqrt(10.0 / 9), 1e-3);
  EXPECT_NEAR(fit->rms_mg, 1, 1e-3);
  EXPECT_NEAR(fit->mean_error_mg, 1, 1e-3);
  // 4 mg per sample and axis, over 120 samples.
  EXPECT_NEAR(fit->noise_sd_mg, 4 / std::sqrt(120.0), 0.02);
}

TEST(BlockFit, ABlockThatContradictsTheOthersIsLeftOut) {
  const SyntheticUnit unit;
  auto blocks = tests::exact_blocks(unit, tests::cube_directions(), 4);
  blocks[50] = tests::exact_block(unit, {0, 0, 1.06});
  const auto fit = fit_blocks(blocks, tests::file_constants(unit));
  ASSERT_OK(fit);
  EXPECT_EQ(fit->blocks_left_out, 1U);
  EXPECT_EQ(fit->left_out_reason,
            "1 of 104 still blocks were left out: more than 15 mg from the magnitude that all "
            "others agree on");
  EXPECT_LT(difference_over_sphere(tests::truth(unit), fit->best().calibration).worst_mg, 1e-3);
}

// The terms that the readings were made with, to first order.
TEST(BlockFit, CrossAxisIsAdmittedWhereItPredictsUnseenDirections) {
  SyntheticUnit unit;
  unit.cross_axis = {0.02, -0.006, 0.004};
  std::mt19937_64 random(1);
  std::vector<tests::Vector> directions;
  for (int i = 0; i < 60; ++i) {
    directions.push_back(tests::random_direction(random));
  }
  const auto fit =
      fit_blocks(tests::exact_blocks(unit, directions, 5), tests::file_constants(unit));
  ASSERT_OK(fit);
  ASSERT_TRUE(fit->richer);
  EXPECT_TRUE(fit->richer->fit.model.cross_axis);
  EXPECT_FALSE(fit->richer->fit.model.temperature);
  for (std::size_t k = 0; k < kAxes; ++k) {
    // The fit goes from readings to g, the sensor from g to readings.
    EXPECT_NEAR(fit->richer->fit.cross_axis[k], -unit.cross_axis[k], 1e-3);
  }
  EXPECT_LT(fit->richer->held_out_rms_mg, 0.1);
  EXPECT_GT(*fit->held_out_rms_mg, 5);
}

// Six sides leave no residual; what cross-axis terms may hide is in the uncertainty all the same.
TEST(BlockFit, SixSidesHaveTheAssumedMisfit) {
  const SyntheticUnit unit;
  const auto fit =
      fit_blocks(tests::exact_blocks(unit, tests::kSixSides, 5), tests::file_constants(unit));
  ASSERT_OK(fit);
  EXPECT_EQ(fit->redundancy, 0);
  EXPECT_NEAR(fit->structural_mg, BlockFitOptions().assumed_structural_mg, 1e-9);
  EXPECT_FALSE(fit->held_out_rms_mg);
}

TEST(BlockFit, RefusesWhatCannotBeFitted) {
  const SyntheticUnit unit;
  const Calibration start = tests::file_constants(unit);
  EXPECT_FAILS(fit_blocks({}, start), ErrorCode::bad_data);
  EXPECT_FAILS(fit_blocks(tests::exact_blocks(unit, {{0, 0, 1}}, 20), start), ErrorCode::bad_data);
  auto blocks = tests::exact_blocks(unit, tests::kSixSides);
  blocks[2].mean_g[0] = std::numeric_limits<double>::infinity();
  EXPECT_FAILS(fit_blocks(blocks, start), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::calib
