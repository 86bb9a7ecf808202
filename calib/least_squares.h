// Least squares on gravity's magnitude: the constants for which every still point reads 1 g.
//
//   SIXPOINT_ASSIGN(const LeastSquaresFit fit, least_squares(points, file_constants));
//   if (fit.converged) {
//     const Calibration& constants = fit.calibration;
//     const ConstantsUncertainty uncertainty = fit.standard_uncertainty();
//   }
//
//     minimise sum_i ((|q_i| - g) / sigma_i)^2,  q_i,a = s_a (m_i,a - zero_a)   (paper, Eq. 4-7)
//
// over the six degrees of freedom (three sensitivities, three zeros), by damped Gauss-Newton with
// an analytic Jacobian. It ends only when both the relative step and the relative gradient are
// small. (The closest-point iteration common in this field stops when its residual no longer falls
// by a fixed amount, which on long files is long before the minimum.) Three symmetric cross-axis
// terms and three temperature coefficients of zero can be freed as well.
//
// A mean vector over a slowly turning block is shorter than gravity; a point therefore carries the
// variance of its ramp, and |q|^2 means s^2 ((m - zero)^2 + variance). The identity is exact, which
// also lets blocks of nearly one direction be merged into one point without loss (cells_of).
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "base/measure.h"
#include "base/result.h"
#include "calib/constants.h"
#include "calib/still_blocks.h"

namespace sixpoint::calib {

// One direction's evidence: the mean reading there, in raw counts, and how well its magnitude is
// known.
struct GravityPoint {
  PerAxis<double> mean_lsb{};
  PerAxis<double> variance_lsb2{};  // of slow turning and merging; adds to the mean square
  double sigma_g = 1e-3;            // standard deviation of the point's magnitude
  double temperature_c = 0;         // above the reference temperature; used by that model only
};

// Six parameters always; the others where the evidence admits them (fit_blocks in block_fit.h).
struct FitModel {
  bool cross_axis = false;   // three symmetric terms xy, xz, yz
  bool temperature = false;  // three temperature coefficients of zero
  int parameters() const { return 6 + (cross_axis ? 3 : 0) + (temperature ? 3 : 0); }
  bool operator==(const FitModel&) const = default;
};

// What is known before the data: normal and independent per constant.
struct CalibrationPrior {
  Calibration mean;
  PerAxis<double> sensitivity_relative_sd{};
  PerAxis<double> zero_g_sd{};
};

struct LeastSquaresOptions {
  FitModel model;
  double gravity_g = 1.0;  // local gravity in standard g
  std::optional<CalibrationPrior> prior;
  // With the cross-axis model: a prior of mean 0 and these standard deviations for the terms xy,
  // xz, yz. 0: free.
  PerAxis<double> cross_axis_sd{};
  // Both have to be reached. Constants are of order one here (relative sensitivity, zero in g).
  double relative_step = 1e-11;
  double relative_gradient = 1e-8;
  int max_iterations = 200;
  // Starts besides the given one: nominal neighbours in a real sensor's range. The lowest minimum
  // wins. 1 for refinement from a known neighbourhood.
  int starts = 7;
};

inline constexpr std::size_t kMaxParameters = 12;

struct LeastSquaresFit {
  Calibration calibration;
  FitModel model;
  PerAxis<double> cross_axis{};      // xy, xz, yz; q = (I + offdiagonal) u
  PerAxis<double> zero_lsb_per_c{};  // temperature coefficients of zero
  // Covariance of (relative sensitivity X Y Z, zero in g X Y Z, cross-axis, zero in g per C), row
  // by row with stride kMaxParameters: the inverse of J'WJ with the sigmas as given.
  std::array<double, kMaxParameters * kMaxParameters> covariance{};
  double chi2 = 0;
  double rms_mg = 0;           // unweighted, over the points
  int degrees_of_freedom = 0;  // points - parameters (+ 6 with a prior)
  // Square root of the ratio of the largest to the smallest eigenvalue of J'WJ: 1 is ideal, above
  // 1e5 the constants are not determined.
  double condition = 0;
  int iterations = 0;  // of the winning start
  bool converged = false;
  int starts_in_basin = 0;  // how many starts ended at the winner
  int starts = 0;

  double covariance_at(std::size_t row, std::size_t column) const {
    return covariance[row * kMaxParameters + column];
  }
  // Variance of a function of the six constants with this slope, in the covariance's order.
  double variance_along(const std::array<double, 6>& slope) const;
  ConstantsUncertainty standard_uncertainty() const;
  // Standard uncertainty, in mg, of the magnitude that these constants give in the direction where
  // it is largest.
  double worst_direction_mg() const;
};

// bad_data for NaN, too few points (below the number of parameters, unless there is a prior) or a
// sigma that is not positive. A fit that did not converge is returned with `converged` false.
Result<LeastSquaresFit> least_squares(std::span<const GravityPoint> points,
                                      const Calibration& start,
                                      const LeastSquaresOptions& options = {});

// |q| of a point under a fit or plain constants, in g.
double magnitude_g(const Calibration& calibration, const PerAxis<double>& mean_lsb,
                   const PerAxis<double>& variance_lsb2);
double magnitude_g(const LeastSquaresFit& fit, const GravityPoint& point);

// 98 directions spread evenly enough over the sphere: the surface of a 5 x 5 x 5 grid of a cube.
std::span<const PerAxis<double>> sphere_grid();

// The largest difference, in mg, between what two calibrations make of a still unit's magnitude,
// over the sphere of directions (as `a` has them), and its root mean square.
struct CalibrationDifference {
  double worst_mg = 0;
  double rms_mg = 0;
};
CalibrationDifference difference_over_sphere(const Calibration& a, const Calibration& b);

}  // namespace sixpoint::calib
