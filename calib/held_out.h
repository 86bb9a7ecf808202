// Directions predicted by fits that have not seen them: the test of constants that does not use the
// data they were fitted to.
//
//   const HeldOutCells in{cells, directions, sigma_g, sigma_g};
//   const HeldOut test = hold_out(in, fit, 1.0, {});  // 1 g, no prior
//   if (test.directions > 0) {
//     const double error_mg = test.rms_mg;
//   }
//
// Pure function; any thread may call it.
#pragma once

#include <optional>
#include <span>

#include "calib/direction_cells.h"
#include "calib/least_squares.h"

namespace sixpoint::calib {

struct HeldOut {
  double rms_mg = 0;
  int directions = 0;  // that the others could predict to 5 mg; 0: rms_mg says nothing
};

struct HeldOutCells {
  std::span<const DirectionCell> cells;
  int directions = 0;                      // neighbourhoods of the cells
  std::span<const double> fit_sigma_g;     // of each cell: its weight in the fits
  std::span<const double> weight_sigma_g;  // and in the root mean square of the errors
};

// Leaves out whole neighbourhoods, a fifth of them at a time, or one where there are fewer than
// 16. Each fit starts from `fit` and has its model.
HeldOut hold_out(const HeldOutCells& in, const LeastSquaresFit& fit, double gravity_g,
                 const std::optional<CalibrationPrior>& prior);

}  // namespace sixpoint::calib
