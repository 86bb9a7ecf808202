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
#include <vector>

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

// One of several ways to predict that are compared on the same cells.
struct HeldOutRival {
  LeastSquaresFit fit;
  std::vector<double> fit_sigma_g;
  bool six_only = false;  // predict with the six constants of the fit, without its other terms
};

// As hold_out(), for each rival in turn; counted are the cells that the fits of all of them predict
// to 5 mg. `in.fit_sigma_g` is not used.
std::vector<HeldOut> hold_out_together(const HeldOutCells& in, std::span<const HeldOutRival> rivals,
                                       double gravity_g,
                                       const std::optional<CalibrationPrior>& prior);

}  // namespace sixpoint::calib
