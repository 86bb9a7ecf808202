#include "calib/held_out.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace sixpoint::calib {

namespace {

// Standard deviation of the magnitude that a fit predicts at a point.
double predicted_sd_g(const LeastSquaresFit& fit, const DirectionCell& cell) {
  const PerAxis<double> g = fit.calibration.to_g(cell.mean_lsb);
  const double length = std::sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  const std::array<double, 6> slope = {g[0] * g[0] / length, g[1] * g[1] / length,
                                       g[2] * g[2] / length, -g[0] / length,
                                       -g[1] / length,       -g[2] / length};
  return std::sqrt(std::max(0.0, fit.variance_along(slope)));
}

}  // namespace

HeldOut hold_out(const HeldOutCells& in, const LeastSquaresFit& fit, double gravity_g,
                 const std::optional<CalibrationPrior>& prior) {
  constexpr int kFew = 15;
  constexpr int kFolds = 5;
  constexpr double kPredictable_g = 0.005;
  const int folds = in.directions <= kFew ? in.directions : kFolds;
  LeastSquaresOptions least;
  least.model = fit.model;
  least.gravity_g = gravity_g;
  least.prior = prior;
  least.starts = 1;
  least.max_iterations = 50;
  double square = 0;
  double weights = 0;
  std::vector<char> tested(static_cast<std::size_t>(in.directions), 0);
  for (int fold = 0; fold < folds; ++fold) {
    std::vector<GravityPoint> others;
    for (std::size_t i = 0; i < in.cells.size(); ++i) {
      if (in.cells[i].neighbourhood % folds != fold) {
        others.push_back(point_of(in.cells[i], in.fit_sigma_g[i]));
      }
    }
    const auto fold_fit = least_squares(others, fit.calibration, least);
    if (!fold_fit || !fold_fit->converged) {
      continue;
    }
    for (std::size_t i = 0; i < in.cells.size(); ++i) {
      if (in.cells[i].neighbourhood % folds != fold ||
          !(predicted_sd_g(*fold_fit, in.cells[i]) < kPredictable_g)) {
        continue;
      }
      const double residual =
          magnitude_g(*fold_fit, point_of(in.cells[i], in.fit_sigma_g[i])) - gravity_g;
      const double weight = 1 / (in.weight_sigma_g[i] * in.weight_sigma_g[i]);
      square += weight * residual * residual;
      weights += weight;
      tested[static_cast<std::size_t>(in.cells[i].neighbourhood)] = 1;
    }
  }
  return {weights > 0 ? kMgPerG * std::sqrt(square / weights) : 0,
          static_cast<int>(std::count(tested.begin(), tested.end(), 1))};
}

}  // namespace sixpoint::calib
