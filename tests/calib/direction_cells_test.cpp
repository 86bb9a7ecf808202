#include "calib/direction_cells.h"

#include <cmath>

#include <gtest/gtest.h>

#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using tests::SyntheticUnit;

// Two readings m - d and m + d have the mean m and the variance d^2.
TEST(DirectionCells, BlocksOfOneDirectionAreOneCell) {
  const SyntheticUnit unit;
  StillBlock low = tests::exact_block(unit, {0, 0, 1});
  StillBlock high = low;
  const double middle = low.mean_lsb[2];
  low.mean_lsb[2] = middle - 3;
  high.mean_lsb[2] = middle + 3;
  low.ramp_variance_lsb2 = {1, 2, 4};
  high.ramp_variance_lsb2 = {3, 2, 6};
  low.temperature_c = 20;
  high.temperature_c = 20.5;
  const auto cells = cells_of(std::vector{low, high});
  ASSERT_EQ(cells.size(), 1U);
  EXPECT_NEAR(cells[0].mean_lsb[2], middle, 1e-12);
  EXPECT_NEAR(cells[0].variance_lsb2[2], 5 + 9, 1e-9);
  EXPECT_NEAR(cells[0].variance_lsb2[0], 2, 1e-9);
  EXPECT_EQ(cells[0].blocks, 2);
  EXPECT_NEAR(cells[0].temperature_c, 0, 1e-12);  // above the mean of 20.25 C
}

TEST(DirectionCells, UnusedBlocksAndOtherTemperaturesAreApart) {
  const SyntheticUnit unit;
  auto blocks = tests::exact_blocks(unit, {{0, 0, 1}, {0, 0, 1}, {1, 0, 0}, {0, 0, 1}});
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    blocks[i].temperature_c = i == 3 ? 40 : 20;
  }
  const std::vector<char> used = {1, 0, 1, 1};
  std::vector<int> cell_of_block;
  EXPECT_EQ(cells_of(blocks, used, &cell_of_block).size(), 3U);
  EXPECT_EQ(cell_of_block, (std::vector<int>{0, -1, 1, 2}));
}

// 11 degrees are one neighbourhood, 13 are two.
TEST(DirectionCells, NeighbourhoodsAreTwelveDegreesWide) {
  const SyntheticUnit unit;
  for (const auto& [degrees, expected] : {std::pair{11.0, 1}, {13.0, 2}}) {
    const double angle = degrees * M_PI / 180;
    auto cells =
        cells_of(tests::exact_blocks(unit, {{0, 0, 1}, {std::sin(angle), 0, std::cos(angle)}}));
    ASSERT_EQ(cells.size(), 2U);
    EXPECT_EQ(number_neighbourhoods(cells, tests::truth(unit)), expected);
    const std::vector<double> sizes = neighbourhood_sizes(cells, expected);
    EXPECT_EQ(sizes, std::vector<double>(2, expected == 1 ? 2.0 : 1.0));
  }
}

// Sensitivities 1 % too large make every magnitude 1.01 g.
TEST(DirectionCells, DistanceFromGravity) {
  const SyntheticUnit unit;
  auto cells = cells_of(tests::exact_blocks(unit, tests::cube_directions()));
  Calibration constants = tests::truth(unit);
  number_neighbourhoods(cells, constants);
  EXPECT_NEAR(cells_rms_mg(cells, constants, 1), 0, 1e-9);
  for (double& sensitivity : constants.sensitivity_g_per_lsb) {
    sensitivity *= 1.01;
  }
  EXPECT_NEAR(cells_rms_mg(cells, constants, 1), 10, 1e-9);
}

// A sensor whose constants are whole numbers: they are found from an estimate beside them.
TEST(DirectionCells, RoundingFindsTheIntegersThatFit) {
  SyntheticUnit unit;
  unit.counts_per_g = {250, 251.5, 247};  // half of positive - negative
  unit.zero_counts = {12, -20, 31};
  const auto cells = cells_of(tests::exact_blocks(unit, tests::cube_directions()));
  Calibration estimate = tests::truth(unit);
  estimate.zero_lsb = {12.6, -20.6, 31.4};
  estimate.sensitivity_g_per_lsb[1] = 2 / 503.8;
  const auto rounded = round_constants(estimate, cells, {}, 1);
  ASSERT_OK(rounded);
  EXPECT_EQ(rounded->zero_lsb, (PerAxis<int>{12, -20, 31}));
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_EQ(rounded->positive_lsb[a] - rounded->negative_lsb[a], 2 * unit.counts_per_g[a]);
  }
}

}  // namespace
}  // namespace sixpoint::calib
