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

constexpr double kPredictable_g = 0.005;

// What the fits without one part of the directions say about that part.
class Fold {
 public:
  Fold(const HeldOutCells& in, int number, int folds) : in_(in), number_(number), folds_(folds) {}

  bool left_out(std::size_t cell) const {
    return in_.cells[cell].neighbourhood % folds_ == number_;
  }

  // False where the others do not determine the rival's constants.
  bool fit(const HeldOutRival& rival, double gravity_g,
           const std::optional<CalibrationPrior>& prior) {
    LeastSquaresOptions least;
    least.model = rival.fit.model;
    least.gravity_g = gravity_g;
    least.prior = prior;
    least.starts = 1;
    least.max_iterations = 50;
    std::vector<GravityPoint> others;
    for (std::size_t i = 0; i < in_.cells.size(); ++i) {
      if (!left_out(i)) {
        others.push_back(point_of(in_.cells[i], rival.fit_sigma_g[i]));
      }
    }
    auto found = least_squares(others, rival.fit.calibration, least);
    if (!found || !found->converged) {
      return false;
    }
    if (rival.six_only) {
      found->cross_axis = {};
      found->zero_lsb_per_c = {};
    }
    fits_.push_back(*std::move(found));
    return true;
  }

  bool predictable(std::size_t cell) const {
    return std::ranges::all_of(fits_, [&](const LeastSquaresFit& fit) {
      return predicted_sd_g(fit, in_.cells[cell]) < kPredictable_g;
    });
  }

  double predicted_g(std::size_t rival, std::size_t cell) const {
    return magnitude_g(fits_[rival], point_of(in_.cells[cell], 1));
  }

 private:
  const HeldOutCells& in_;
  int number_;
  int folds_;
  std::vector<LeastSquaresFit> fits_;
};

}  // namespace

std::vector<HeldOut> hold_out_together(const HeldOutCells& in, std::span<const HeldOutRival> rivals,
                                       double gravity_g,
                                       const std::optional<CalibrationPrior>& prior) {
  constexpr int kFew = 15;
  constexpr int kFolds = 5;
  const int folds = in.directions <= kFew ? in.directions : kFolds;
  std::vector<double> square(rivals.size(), 0);
  double weights = 0;
  std::vector<char> tested(static_cast<std::size_t>(in.directions), 0);
  for (int number = 0; number < folds; ++number) {
    Fold fold(in, number, folds);
    if (!std::ranges::all_of(
            rivals, [&](const HeldOutRival& rival) { return fold.fit(rival, gravity_g, prior); })) {
      continue;
    }
    for (std::size_t i = 0; i < in.cells.size(); ++i) {
      if (!fold.left_out(i) || !fold.predictable(i)) {
        continue;
      }
      const double weight = 1 / (in.weight_sigma_g[i] * in.weight_sigma_g[i]);
      for (std::size_t k = 0; k < rivals.size(); ++k) {
        const double residual = fold.predicted_g(k, i) - gravity_g;
        square[k] += weight * residual * residual;
      }
      weights += weight;
      tested[static_cast<std::size_t>(in.cells[i].neighbourhood)] = 1;
    }
  }
  const auto directions = static_cast<int>(std::count(tested.begin(), tested.end(), 1));
  std::vector<HeldOut> out;
  out.reserve(square.size());
  for (const double sum : square) {
    out.push_back({weights > 0 ? kMgPerG * std::sqrt(sum / weights) : 0, directions});
  }
  return out;
}

HeldOut hold_out(const HeldOutCells& in, const LeastSquaresFit& fit, double gravity_g,
                 const std::optional<CalibrationPrior>& prior) {
  const HeldOutRival only = {fit, {in.fit_sigma_g.begin(), in.fit_sigma_g.end()}, false};
  return hold_out_together(in, std::span(&only, 1), gravity_g, prior).front();
}

}  // namespace sixpoint::calib
