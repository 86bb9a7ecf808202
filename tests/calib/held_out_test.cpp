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

// Rivals are tested on the same cells, each by its own fits.
TEST(HeldOut, RivalsStandSideBySide) {
  SyntheticUnit unit;
  unit.cross_axis = {0.02, 0, 0};
  auto cells = cells_of(tests::exact_blocks(unit, tests::cube_directions()));
  const int number = number_neighbourhoods(cells, tests::truth(unit));
  const std::vector<double> sigma_g(cells.size(), 1e-3);
  const auto six = least_squares(points_of(cells, sigma_g), tests::truth(unit));
  LeastSquaresOptions options;
  options.model.cross_axis = true;
  const auto terms = least_squares(points_of(cells, sigma_g), tests::truth(unit), options);
  ASSERT_OK(six);
  ASSERT_OK(terms);
  const HeldOutRival rivals[] = {
      {*six, sigma_g, false}, {*terms, sigma_g, false}, {*terms, sigma_g, true}};
  const HeldOutCells in = {cells, number, {}, sigma_g};
  const auto tested = hold_out_together(in, rivals, 1, {});
  ASSERT_EQ(tested.size(), 3U);
  EXPECT_LT(tested[1].rms_mg, 0.5);
  EXPECT_GT(tested[0].rms_mg, 5);
  EXPECT_GT(tested[2].rms_mg, 5) << "without the terms the sensor's own six are no better";
  for (const HeldOut& one : tested) {
    EXPECT_EQ(one.directions, tested.front().directions);
    EXPECT_GT(one.directions, 20);
  }
}

// Five sides do not determine six constants, so nothing can be predicted.
TEST(HeldOut, SixSidesCannotPredictEachOther) {
  EXPECT_EQ(hold_out_of({}, tests::kSixSides).directions, 0);
}

}  // namespace
}  // namespace sixpoint::calib
