#include "calib/poses/efficiency.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

#include "calib/least_squares.h"

namespace sixpoint::calib {

namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

VectorXd regressors(const Vector3d& u, int parameters) {
  VectorXd r(parameters);
  r.head<3>() = u.cwiseAbs2();
  r.segment<3>(3) = u;
  if (parameters > 6) {
    r.tail<3>() << u.y() * u.z(), u.x() * u.z(), u.x() * u.y();
  }
  return r;
}

// Of the best sets: six sides, and twelve poses of an icosahedron, whose moments up to the fourth
// are those of the whole sphere (mean of ux^4 1/5, of ux^2 uy^2 1/15).
MatrixXd best_information(int parameters) {
  MatrixXd m = MatrixXd::Identity(parameters, parameters) / 3;
  if (parameters > 6) {
    m.topLeftCorner<3, 3>().setConstant(1.0 / 15);
    m.topLeftCorner<3, 3>().diagonal().setConstant(1.0 / 5);
    m.bottomRightCorner<3, 3>() /= 5;
  }
  return m;
}

// Above this condition a determinant is rounding alone.
constexpr double kMostCondition = 1e12;

DesignEfficiency efficiency(const MatrixXd& information) {
  const auto n = static_cast<int>(information.rows());
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(information);
  if (!(eigen.eigenvalues()[0] * kMostCondition > eigen.eigenvalues()[n - 1])) {
    return {};
  }
  DesignEfficiency out;
  const double log_best = best_information(n).ldlt().vectorD().array().log().sum();
  out.d = std::exp((eigen.eigenvalues().array().log().sum() - log_best) / n);
  const MatrixXd inverse = eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() *
                           eigen.eigenvectors().transpose();
  const auto variance = [&](const Vector3d& u) {
    const VectorXd r = regressors(u, n);
    return r.dot(inverse * r);
  };
  double worst = 0;
  for (const PerAxis<double>& start : sphere_grid()) {
    // Uphill from every point of the grid, by halved steps.
    Vector3d u = Vector3d(start[0], start[1], start[2]).normalized();
    double here = variance(u);
    for (double step = 0.2; step > 1e-4;) {
      const Vector3d across = u.unitOrthogonal();
      const Vector3d along = u.cross(across);
      bool is_better = false;
      for (const Vector3d& way : {across, along, Vector3d(-across), Vector3d(-along)}) {
        const Vector3d there = (u + step * way).normalized();
        if (const double value = variance(there); value > here) {
          u = there;
          here = value;
          is_better = true;
          break;
        }
      }
      step = is_better ? step : step / 2;
    }
    worst = std::max(worst, here);
  }
  out.g = n / worst;
  return out;
}

}  // namespace

DesignEfficiency efficiency_of(const BlockFit& fit, int parameters) {
  MatrixXd information = MatrixXd::Zero(parameters, parameters);
  double weights = 0;
  for (std::size_t k = 0; k < fit.cells.size(); ++k) {
    const Calibration& c = fit.best().calibration;
    Vector3d u;
    for (std::size_t a = 0; a < kAxes; ++a) {
      u[static_cast<Eigen::Index>(a)] =
          c.sensitivity_g_per_lsb[a] * (fit.cells[k].mean_lsb[a] - c.zero_lsb[a]);
    }
    const VectorXd r = regressors(u.normalized(), parameters);
    const double weight = 1 / std::pow(fit.cell_sigma_mg[k], 2);
    information += weight * r * r.transpose();
    weights += weight;
  }
  if (!(weights > 0) || !std::isfinite(weights)) {
    return {};
  }
  return efficiency(information / weights);
}

nlohmann::ordered_json solve_json(const SolveReport& report) {
  nlohmann::ordered_json json = to_json(report);
  if (!report.fit) {
    return json;
  }
  const BlockFit& fit = *report.fit;
  json["efficiency"]["parameters"] = fit.best().model.cross_axis ? 9 : 6;
  for (const auto& [name, parameters] : {std::pair{"six", 6}, std::pair{"nine", 9}}) {
    const DesignEfficiency efficiency = efficiency_of(fit, parameters);
    json["efficiency"][name] = {{"d", efficiency.d}, {"g", efficiency.g}};
  }
  return json;
}

}  // namespace sixpoint::calib
