// Zeros that drift with time: what a file shows of them, and what it cannot show.
//
//   if (const auto drift = zero_drift(points)) {
//     const double hidden_mg = drift->allowance_mg();
//   }
//
// A calibration file of six sides laid one after another has no residual. When the unit warms up
// meanwhile, each side is measured with another zero, and the fit takes that for sensitivity and
// zero. Two things show a drift: the magnitude of a side at rest has a trend, and a side that is
// measured again later has another magnitude. Both are fitted with one straight line per axis:
//
//     error(block) = n_a^2 gain_a - n_a zero_a + cross-axis + misfit(direction)
//                  + n_a rate_a (time - middle of the file)
//
// with n the direction, by least squares with and without the rates. What the rates add to the
// covariance of the constants is what a drift could have done to them without being shown; how far
// they move the constants is the best estimate of what it did. A file whose sides were at rest for
// a tenth of its time cannot separate a slow drift from constants. Its uncertainty is large then,
// and the remedy is to go round the sides a second time.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "base/measure.h"

namespace sixpoint::calib {

struct ZeroDriftOptions {
  // A unit that comes from the cold takes the room's temperature within an hour. What drifts over
  // the days of a wear follows no straight line, and there each direction is met at all hours.
  static constexpr double most_span_s = 3 * 3600.0;
  // All three axes together, chi-square of 3 degrees of freedom: one good file in 1000. 20 C at 0.5
  // mg/C make several times as much.
  static constexpr double least_chi2 = 16.3;
  // The same of the level axes, for visits of so many blocks (20 s), and where their slopes are
  // enough to show how they scatter.
  static constexpr double level_blocks = 5;
  static constexpr double least_level_freedom = 9;
  // Fewer blocks beyond what the lines take say too little about their own scatter; it is at least
  // `block_sd_g` then.
  static constexpr double least_freedom = 20;
  double block_sd_g = 5e-4;
  // What the six constants leave in a direction, and what they leave of it from one visit to the
  // next (hysteresis, seating: 0.8 mg in the list of effects).
  double misfit_sd_g = 1.5e-3;
  static constexpr double visit_sd_g = 5e-4;
  PerAxis<double> cross_axis_sd = {0.024, 0.005, 0.005};  // as in BlockFitOptions
  // Before the data: 20 C at the ADXL362's 0.5 mg/C, either way, and twice that. From the middle of
  // the file to its end.
  static constexpr double rate_sd_g = 0.010;
};

struct DriftPoint {
  double time_s = 0;
  PerAxis<double> mean_g{};  // calibrated
  double error_g = 0;        // magnitude less gravity
  int direction = 0;         // points of one number share a misfit (DirectionCell::neighbourhood)
  double duration_s = 0;     // of the block
};

struct ZeroDrift {
  // Change of each axis' zero from the middle of the file to its end.
  PerAxis<double> half_span_mg{};
  PerAxis<double> standard_uncertainty_mg{};
  double chi2 = 0;
  bool shown = false;
  double span_s = 0;     // from the first point to the last
  double within_s = 0;   // from the first block's start to the last one's end
  double at_rest_s = 0;  // of the blocks together: what was sampled
  int visits = 0;
  // What not knowing the rates adds to the covariance of (relative sensitivity X Y Z, zero in g
  // X Y Z), row by row, and how far knowing them would move the constants.
  std::array<double, 36> hidden{};
  std::array<double, 6> apart{};

  // The upper 95 % bounds of |half_span_mg| as a vector where a drift is shown, 0 where not.
  double shown_mg() const;
  // Standard deviation of the magnitude in the worst direction for what is hidden alone, and with
  // what the drift seems to have done.
  double hidden_mg() const;
  double allowance_mg() const;
  // Of the constants, the same.
  PerAxis<double> sensitivity_relative() const;
  PerAxis<double> zero_mg() const;
};

// In order of time. Nothing for a longer file than most_span_s, and for fewer than two visits.
std::optional<ZeroDrift> zero_drift(std::span<const DriftPoint> points,
                                    const ZeroDriftOptions& options = {});

}  // namespace sixpoint::calib
