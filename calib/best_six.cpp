#include "calib/best_six.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "calib/held_out.h"
#include "calib/verify.h"

namespace sixpoint::calib {

namespace {

// In g, as the fit has them.
std::vector<double> direction_sigma_g(const BlockFit& fit) {
  std::vector<double> out;
  for (const double sigma_mg : fit.cell_sigma_mg) {
    out.push_back(sigma_mg / kMgPerG);
  }
  return out;
}

// Every block equal, in sum as much weight as every direction equal has.
std::vector<double> time_sigma_g(const BlockFit& fit) {
  double weights = 0;
  double blocks = 0;
  for (std::size_t k = 0; k < fit.cells.size(); ++k) {
    weights += 1 / (fit.cell_sigma_mg[k] * fit.cell_sigma_mg[k]);
    blocks += fit.cells[k].blocks;
  }
  std::vector<double> out;
  for (const DirectionCell& cell : fit.cells) {
    out.push_back(std::sqrt(blocks / (cell.blocks * weights)) / kMgPerG);
  }
  return out;
}

double over_sphere_mg(const LeastSquaresFit& fit, const Calibration& six) {
  double worst = 0;
  for (const PerAxis<double>& n : sphere_grid()) {
    // The reading of a sensor with these terms, to first order: u = n - C n.
    const auto& [xy, xz, yz] = fit.cross_axis;
    const PerAxis<double> u = {n[0] - xy * n[1] - xz * n[2], n[1] - xy * n[0] - yz * n[2],
                               n[2] - xz * n[0] - yz * n[1]};
    GravityPoint point;
    for (std::size_t a = 0; a < kAxes; ++a) {
      point.mean_lsb[a] =
          fit.calibration.zero_lsb[a] + u[a] / fit.calibration.sensitivity_g_per_lsb[a];
    }
    worst =
        std::max(worst, std::abs(magnitude_g(six, point.mean_lsb, {}) - magnitude_g(fit, point)));
  }
  return kMgPerG * worst;
}

}  // namespace

std::string_view to_string(SixFrom from) {
  constexpr std::array<std::string_view, 4> kNames = {"of_fit", "of_sensor", "of_directions",
                                                      "of_time"};
  return kNames[static_cast<std::size_t>(from)];
}

double BestSix::unseen_chosen_mg() const {
  if (!unseen_mg) {
    return 0;
  }
  return from == SixFrom::of_time         ? unseen_mg->of_time
         : from == SixFrom::of_directions ? unseen_mg->of_directions
                                          : unseen_mg->of_sensor;
}

BestSix best_six(const BlockFit& fit, double gravity_g) {
  constexpr int kFewestDirections = 30;
  BestSix out;
  out.calibration = fit.best().calibration;
  out.cell_sigma_mg = fit.cell_sigma_mg;
  if (!fit.richer || !fit.richer->fit.model.cross_axis) {
    return out;
  }
  out.from = SixFrom::of_sensor;
  const std::vector<double> direction_g = direction_sigma_g(fit);
  const std::vector<double> time_g = time_sigma_g(fit);
  LeastSquaresOptions options;
  options.gravity_g = gravity_g;
  options.starts = 1;
  const auto of_time = least_squares(points_of(fit.cells, time_g), fit.fit.calibration, options);
  if (!of_time || !of_time->converged) {
    out.elsewhere_mg = over_sphere_mg(fit.best(), out.calibration);
    return out;
  }
  const std::array<HeldOutRival, 4> rivals = {{{fit.richer->fit, direction_g, true},
                                               {fit.fit, direction_g, true},
                                               {*of_time, time_g, true},
                                               {fit.richer->fit, direction_g, false}}};
  const auto tested = hold_out_together({fit.cells, fit.directions, direction_g, time_g}, rivals,
                                        gravity_g, std::nullopt);
  out.unseen_mg = {tested[0].rms_mg, tested[1].rms_mg, tested[2].rms_mg, tested[3].rms_mg,
                   tested[0].directions};
  double best_mg = BlockFitOptions::model_gain * out.unseen_mg->of_sensor;
  const auto try_six = [&](const LeastSquaresFit& six, double unseen_mg, SixFrom from) {
    if (tested[0].directions >= kFewestDirections && unseen_mg < best_mg &&
        cells_rms_mg(fit.cells, six.calibration, gravity_g) <= VerificationLimits::applied_mg) {
      best_mg = unseen_mg;
      out.calibration = six.calibration;
      out.from = from;
    }
  };
  try_six(fit.fit, out.unseen_mg->of_directions, SixFrom::of_directions);
  try_six(*of_time, out.unseen_mg->of_time, SixFrom::of_time);
  if (out.from == SixFrom::of_time) {
    for (std::size_t k = 0; k < time_g.size(); ++k) {
      out.cell_sigma_mg[k] = kMgPerG * time_g[k];
    }
  }
  out.elsewhere_mg = over_sphere_mg(fit.best(), out.calibration);
  return out;
}

std::optional<CrossAxisMap> cross_axis_map(const BlockFit& fit, const BestSix& six,
                                           double gravity_relative_sd) {
  if (!fit.richer || !fit.richer->fit.model.cross_axis || !six.unseen_mg) {
    return std::nullopt;
  }
  const LeastSquaresFit& more = fit.richer->fit;
  CrossAxisMap out;
  out.calibration = more.calibration;
  out.cross_axis = more.cross_axis;
  out.uncertainty = more.standard_uncertainty();
  for (std::size_t a = 0; a < kAxes; ++a) {
    double& relative = out.uncertainty.sensitivity_relative[a];
    relative = std::hypot(relative, gravity_relative_sd);
    out.cross_axis_sd[a] = std::sqrt(std::max(0.0, more.covariance_at(6 + a, 6 + a)));
  }
  out.unseen_directions = six.unseen_mg->directions;
  out.unseen_mg = six.unseen_mg->matrix;
  out.six_unseen_mg = six.unseen_chosen_mg();
  return out;
}

double worst_direction_with_terms_mg(const LeastSquaresFit& fit) {
  double worst = 0;
  for (const PerAxis<double>& n : sphere_grid()) {
    const std::array<double, 9> slope = {n[0] * n[0],     n[1] * n[1],     n[2] * n[2],
                                         -n[0],           -n[1],           -n[2],
                                         2 * n[0] * n[1], 2 * n[0] * n[2], 2 * n[1] * n[2]};
    const std::size_t terms = fit.model.cross_axis ? 9 : 6;
    double variance = 0;
    for (std::size_t i = 0; i < terms; ++i) {
      for (std::size_t j = 0; j < terms; ++j) {
        variance += slope[i] * slope[j] * fit.covariance_at(i, j);
      }
    }
    worst = std::max(worst, variance);
  }
  return kMgPerG * std::sqrt(worst);
}

}  // namespace sixpoint::calib
