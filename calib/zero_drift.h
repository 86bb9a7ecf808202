// Zeros that drift with time, seen while a unit lies on one side.
//
// A calibration file of six sides laid one after another has no residual: when the unit warms up
// meanwhile, each side is met by another zero, and the constants take that for sensitivity and
// zero. What gives it away is the trend within each side. Blocks are parted into stretches wherever
// the mean jumps from one to the next, and the errors of the magnitude are regressed on time:
//
//     error(block) = level(stretch) + sum over axes of rate_a * n_a * (time - mean time of stretch)
//
// with n the stretch's direction. Each stretch keeps its own level, so that the rates are not
// confounded with which side was laid when, nor with wrong constants.
#pragma once

#include <optional>
#include <span>

#include "base/measure.h"

namespace sixpoint::calib {

struct ZeroDriftOptions {
  // A jump of more than this on any axis from one block to the next: another stretch (as in
  // TemperatureDriftOptions).
  double moved_g = 0.015;
  // A unit that comes from the cold takes the room's temperature within an hour. What drifts over
  // the days of a wear follows no straight line, and there each direction is met at all hours.
  double most_span_s = 3 * 3600.0;
  // Three axes are tested in each of thousands of files; at 3 one good file in 120 would pass for
  // one that drifts, at 4 one in 5000. 20 C at 0.5 mg/C make 6 and more.
  double least_t = 4.0;
  // Fewer blocks beyond what the lines take say too little about their own scatter for that.
  double least_freedom = 20;
};

struct DriftPoint {
  double time_s = 0;
  PerAxis<double> mean_g{};  // calibrated
  double error_g = 0;        // magnitude less gravity
};

// Change of each axis' zero from the middle of the file to its end, if it goes on as within sides.
struct ZeroDrift {
  PerAxis<double> half_span_mg{};
  PerAxis<double> standard_uncertainty_mg{};
  PerAxis<bool> significant{};
  double span_s = 0;
  int stretches = 0;  // that had a trend to show

  // The upper 95 % bound of |half_span_mg| where it is significant, 0 where not.
  double bound_mg(std::size_t axis) const;
  double worst_mg() const;  // of the three bounds, as a vector
};

// In order of time. Nothing for a longer file than most_span_s, and where the stretches do not tell
// three axes apart or have too few blocks.
std::optional<ZeroDrift> zero_drift(std::span<const DriftPoint> points,
                                    const ZeroDriftOptions& options = {});

}  // namespace sixpoint::calib
