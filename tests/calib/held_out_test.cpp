#include "calib/held_out.h"

#include <gtest/gtest.h>

#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using tests::SyntheticUnit;

HeldOut hold_out_of(const SyntheticUnit& unit, const std::vector<tests::Vector>& directions) {
  auto cells = cells_of(tests::exact_blocks(unit, directions));
  const int number = number_neighbourhoods(cells, tests::truth(unit));
  const std::vector<double> sigma_g(cells.size(), 1e-3);
  const auto fit = least_squares(points_of(cells, sigma_g), tests::truth(unit));
  EXPECT_OK(fit);
  return hold_out({cells, number, sigma_g, sigma_g}, *fit, 1, {});
}

TEST(HeldOut, ExactDirectionsArePredictedExactly) {
  const HeldOut test = hold_out_of({}, tests::cube_directions());
  EXPECT_EQ(test.directions, 26);
  EXPECT_LT(test.rms_mg, 1e-6);
}

// Cross-axis terms of 2 % that the six constants cannot follow: of the same size as the error in
// the directions between two axes, 2 * 0.02 * n_x * n_y, which is 20 mg at 45 degrees.
TEST(HeldOut, WhatTheModelLacksIsMeasured) {
  SyntheticUnit unit;
  unit.cross_axis = {0.02, 0, 0};
  const HeldOut test = hold_out_of(unit, tests::cube_directions());
  EXPECT_GT(test.directions, 20);
  EXPECT_GT(test.rms_mg, 5);
  EXPECT_LT(test.rms_mg, 30);
}

// Five sides do not determine six constants, so nothing can be predicted.
TEST(HeldOut, SixSidesCannotPredictEachOther) {
  EXPECT_EQ(hold_out_of({}, tests::kSixSides).directions, 0);
}

}  // namespace
}  // namespace sixpoint::calib
