#include "calib/least_squares.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "exact_blocks.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using tests::SyntheticUnit;

std::vector<GravityPoint> points_in(const SyntheticUnit& unit,
                                    const std::vector<tests::Vector>& directions, double sigma_g) {
  std::vector<GravityPoint> points;
  for (const StillBlock& block : tests::exact_blocks(unit, directions)) {
    points.push_back({block.mean_lsb, {}, sigma_g, 0});
  }
  return points;
}

TEST(LeastSquares, ExactReadingsGiveTheExactConstants) {
  SyntheticUnit unit;
  unit.cross_axis = {0.02, -0.01, 0.005};
  LeastSquaresOptions options;
  options.model.cross_axis = true;
  const auto fit = least_squares(points_in(unit, tests::cube_directions(), 1e-3),
                                 tests::file_constants(unit), options);
  ASSERT_OK(fit);
  EXPECT_TRUE(fit->converged);
  EXPECT_LT(fit->rms_mg, 1e-6);
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_NEAR(fit->cross_axis[a], -unit.cross_axis[a], 1e-3);
  }
  for (const GravityPoint& point : points_in(unit, tests::cube_directions(), 1e-3)) {
    EXPECT_NEAR(magnitude_g(*fit, point), 1, 1e-9);
  }
}

// Six faces of sigma s: each sensitivity and each zero is the half sum or half difference of two
// magnitudes, so its standard uncertainty is s / sqrt(2), and the worst direction's is s.
TEST(LeastSquares, UncertaintyOfSixFaces) {
  constexpr double kSigma_g = 0.002;
  const SyntheticUnit unit;
  const auto fit = least_squares(points_in(unit, tests::kSixSides, kSigma_g), tests::truth(unit));
  ASSERT_OK(fit);
  const ConstantsUncertainty uncertainty = fit->standard_uncertainty();
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_NEAR(uncertainty.sensitivity_relative[a], kSigma_g / std::sqrt(2), 1e-9);
    EXPECT_NEAR(uncertainty.zero_mg[a], 1000 * kSigma_g / std::sqrt(2), 1e-6);
  }
  EXPECT_NEAR(fit->worst_direction_mg(), 1000 * kSigma_g, 1e-6);
  EXPECT_EQ(fit->degrees_of_freedom, 0);
  EXPECT_NEAR(fit->variance_along({1, 0, 0, 0, 0, 0}), kSigma_g * kSigma_g / 2, 1e-12);
}

// The posterior of equal information in data and prior lies in the middle.
TEST(LeastSquares, APriorCountsByItsInformation) {
  const SyntheticUnit unit;
  Calibration mean = tests::truth(unit);
  mean.zero_lsb[0] += 0.01 * unit.counts_per_g[0];  // 10 mg
  LeastSquaresOptions options;
  const double sd = 0.002 / std::sqrt(2);  // of the data, as above
  options.prior = CalibrationPrior{mean, {1e3, 1e3, 1e3}, {sd, sd, sd}};
  const auto fit =
      least_squares(points_in(unit, tests::kSixSides, 0.002), tests::truth(unit), options);
  ASSERT_OK(fit);
  EXPECT_NEAR(fit->calibration.zero_lsb[0], unit.zero_counts[0] + 0.005 * unit.counts_per_g[0],
              1e-3);
}

TEST(LeastSquares, DifferenceOverTheSphere) {
  const SyntheticUnit unit;
  const Calibration a = tests::truth(unit);
  Calibration larger = a;
  for (double& sensitivity : larger.sensitivity_g_per_lsb) {
    sensitivity *= 1.02;
  }
  EXPECT_NEAR(difference_over_sphere(a, larger).worst_mg, 20, 1e-9);
  EXPECT_NEAR(difference_over_sphere(a, larger).rms_mg, 20, 1e-9);
  Calibration shifted = a;
  shifted.zero_lsb[1] += 0.03 * unit.counts_per_g[1];
  EXPECT_NEAR(difference_over_sphere(a, shifted).worst_mg, 30, 1e-9);  // along -y and +y
  EXPECT_NEAR(difference_over_sphere(a, a).worst_mg, 0, 1e-9);
}

// 98 unit vectors, each with its opposite.
TEST(LeastSquares, TheGridOfDirectionsIsEven) {
  PerAxis<double> sum{};
  for (const PerAxis<double>& n : sphere_grid()) {
    EXPECT_NEAR(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1, 1e-12);
    for (std::size_t a = 0; a < kAxes; ++a) {
      sum[a] += n[a];
    }
  }
  EXPECT_EQ(sphere_grid().size(), 5U * 5U * 5U - 3U * 3U * 3U);
  for (const double component : sum) {
    EXPECT_NEAR(component, 0, 1e-12);
  }
}

TEST(LeastSquares, RefusesWhatCannotBeSolved) {
  const SyntheticUnit unit;
  const Calibration start = tests::truth(unit);
  auto points = points_in(unit, tests::kSixSides, 1e-3);
  EXPECT_FAILS(least_squares(std::span(points).first(5), start), ErrorCode::bad_data);
  points[0].sigma_g = 0;
  EXPECT_FAILS(least_squares(points, start), ErrorCode::bad_data);
  points[0].sigma_g = 1e-3;
  points[3].mean_lsb[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FAILS(least_squares(points, start), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::calib
