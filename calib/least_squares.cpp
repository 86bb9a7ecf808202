#include "calib/least_squares.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace sixpoint::calib {

namespace {

constexpr int kMax = static_cast<int>(kMaxParameters);
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMax, kMax>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMax, 1>;

constexpr PerAxis<std::array<std::size_t, 2>> kPair = {{{0, 1}, {0, 2}, {1, 2}}};

// Parameters: relative change of sensitivity and change of zero in g, from a base calibration.
struct Problem {
  std::span<const GravityPoint> points;
  Calibration base;
  LeastSquaresOptions options;

  int size() const { return options.model.parameters(); }
  int temperature_offset() const { return options.model.cross_axis ? 9 : 6; }

  Calibration calibration(const Vector& theta) const {
    Calibration out;
    for (std::size_t a = 0; a < kAxes; ++a) {
      const auto i = static_cast<Eigen::Index>(a);
      out.sensitivity_g_per_lsb[a] = base.sensitivity_g_per_lsb[a] * (1 + theta[i]);
      out.zero_lsb[a] = base.zero_lsb[a] + theta[3 + i] / base.sensitivity_g_per_lsb[a];
    }
    return out;
  }

  // The length of q = (I + C) u with its ramp, and what its slopes need.
  struct Evaluated {
    PerAxis<double> u{};
    PerAxis<double> spread{};
    PerAxis<double> q{};
    double length = 0;
  };

  Evaluated evaluate(const Vector& theta, const GravityPoint& point) const {
    Evaluated out;
    for (std::size_t a = 0; a < kAxes; ++a) {
      const auto i = static_cast<Eigen::Index>(a);
      const double s0 = base.sensitivity_g_per_lsb[a];
      double level = s0 * (point.mean_lsb[a] - base.zero_lsb[a]) - theta[3 + i];
      if (options.model.temperature) {
        level -= theta[temperature_offset() + i] * point.temperature_c;
      }
      const double gain = 1 + theta[i];
      out.u[a] = gain * level;
      out.spread[a] = gain * gain * s0 * s0 * point.variance_lsb2[a];
    }
    out.q = out.u;
    add_cross_axis(theta, out.u, out.q);
    const PerAxis<double>& q = out.q;
    const double square =
        q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + out.spread[0] + out.spread[1] + out.spread[2];
    out.length = std::sqrt(std::max(square, 1e-12));
    return out;
  }

  // to += C from.
  void add_cross_axis(const Vector& theta, const PerAxis<double>& from, PerAxis<double>& to) const {
    for (std::size_t k = 0; options.model.cross_axis && k < kAxes; ++k) {
      const double c = theta[6 + static_cast<Eigen::Index>(k)];
      to[kPair[k][0]] += c * from[kPair[k][1]];
      to[kPair[k][1]] += c * from[kPair[k][0]];
    }
  }

  // Slope of the length in each parameter; d|q|/du = C'q / |q|.
  void slopes(const Vector& theta, const GravityPoint& point, const Evaluated& at,
              std::array<double, kMaxParameters>& row) const {
    PerAxis<double> pull = at.q;
    add_cross_axis(theta, at.q, pull);
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double gain = 1 + theta[static_cast<Eigen::Index>(a)];
      row[a] = (pull[a] * at.u[a] + at.spread[a]) / (gain * at.length);
      row[3 + a] = -pull[a] * gain / at.length;
      if (options.model.temperature) {
        row[static_cast<std::size_t>(temperature_offset()) + a] = row[3 + a] * point.temperature_c;
      }
      if (options.model.cross_axis) {
        row[6 + a] =
            (at.q[kPair[a][0]] * at.u[kPair[a][1]] + at.q[kPair[a][1]] * at.u[kPair[a][0]]) /
            at.length;
      }
    }
  }

  // Adds up cost, gradient J'Wr and J'WJ at theta.
  double evaluate(const Vector& theta, Vector& gradient, Matrix& hessian) const {
    const auto n = static_cast<std::size_t>(size());
    double cost = 0;
    std::array<double, kMaxParameters> row{};
    std::array<double, kMaxParameters * kMaxParameters> sum{};
    std::array<double, kMaxParameters> slope{};
    for (const GravityPoint& point : points) {
      const Evaluated at = evaluate(theta, point);
      const double weight = 1 / (point.sigma_g * point.sigma_g);
      const double residual = at.length - options.gravity_g;
      cost += weight * residual * residual;
      slopes(theta, point, at, row);
      for (std::size_t i = 0; i < n; ++i) {
        slope[i] += weight * residual * row[i];
        for (std::size_t j = 0; j <= i; ++j) {
          sum[i * kMaxParameters + j] += weight * row[i] * row[j];
        }
      }
    }
    gradient.resize(size());
    hessian.resize(size(), size());
    for (std::size_t i = 0; i < n; ++i) {
      gradient[static_cast<Eigen::Index>(i)] = slope[i];
      for (std::size_t j = 0; j <= i; ++j) {
        const auto r = static_cast<Eigen::Index>(i);
        const auto c = static_cast<Eigen::Index>(j);
        hessian(r, c) = hessian(c, r) = sum[i * kMaxParameters + j];
      }
    }
    if (options.prior) {
      cost += add_prior(theta, gradient, hessian);
    }
    for (Eigen::Index i = 6; options.model.cross_axis && i < 9; ++i) {
      const double sd = options.cross_axis_sd[static_cast<std::size_t>(i - 6)];
      if (sd > 0) {
        const double weight = 1 / (sd * sd);
        cost += weight * theta[i] * theta[i];
        gradient[i] += weight * theta[i];
        hessian(i, i) += weight;
      }
    }
    return cost;
  }

  // A parameter that is known to be about `wanted` before the data. Returns its cost.
  static double add_normal(const Vector& theta, Eigen::Index i, double wanted, double sd,
                           Vector& gradient, Matrix& hessian) {
    const double off = theta[i] - wanted;
    gradient[i] += off / (sd * sd);
    hessian(i, i) += 1 / (sd * sd);
    return off * off / (sd * sd);
  }

  double add_prior(const Vector& theta, Vector& gradient, Matrix& hessian) const {
    double cost = 0;
    const CalibrationPrior& prior = *options.prior;
    for (std::size_t a = 0; a < kAxes; ++a) {
      const auto i = static_cast<Eigen::Index>(a);
      const double s0 = base.sensitivity_g_per_lsb[a];
      const double gain_wanted = prior.mean.sensitivity_g_per_lsb[a] / s0 - 1;
      const double zero_wanted = s0 * (prior.mean.zero_lsb[a] - base.zero_lsb[a]);
      const double gain_cost =
          add_normal(theta, i, gain_wanted, prior.sensitivity_relative_sd[a], gradient, hessian);
      cost +=
          gain_cost + add_normal(theta, 3 + i, zero_wanted, prior.zero_g_sd[a], gradient, hessian);
    }
    return cost;
  }
};

struct Descent {
  Vector theta;
  double cost = 0;
  int iterations = 0;
  bool converged = false;
};

// The largest cosine of the angle between the residual vector and a column of the Jacobian.
double steepest_cosine(const Vector& gradient, const Matrix& hessian, double cost) {
  double steepest = 0;
  for (Eigen::Index i = 0; i < gradient.size(); ++i) {
    const double scale = std::sqrt(hessian(i, i) * cost);
    steepest = std::max(steepest, scale > 0 ? std::abs(gradient[i]) / scale : 0.0);
  }
  return steepest;
}

Descent descend(const Problem& problem, const Vector& start) {
  const int n = problem.size();
  Descent out;
  out.theta = start;
  Vector gradient(n);
  Matrix hessian(n, n);
  out.cost = problem.evaluate(out.theta, gradient, hessian);
  double damping = 1e-4;
  // Where the residuals are rounding errors of the arithmetic, no gradient test can say more.
  double weights = 0;
  for (const GravityPoint& point : problem.points) {
    weights += 1 / (point.sigma_g * point.sigma_g);
  }
  const double cost_floor = weights * 1e-26;
  while (out.iterations < problem.options.max_iterations) {
    ++out.iterations;
    Matrix damped = hessian;
    damped.diagonal() += damping * hessian.diagonal();
    const Eigen::LDLT<Matrix> factors(damped);
    const Vector step = -factors.solve(gradient);
    Vector moved = out.theta + step;
    // A sensitivity can neither vanish nor change its sign.
    bool sane = moved.allFinite();
    for (int a = 0; a < 3 && sane; ++a) {
      sane = moved[a] > -0.9 && moved[a] < 9;
    }
    Vector moved_gradient(n);
    Matrix moved_hessian(n, n);
    const double moved_cost =
        sane ? problem.evaluate(moved, moved_gradient, moved_hessian) : HUGE_VAL;
    const bool small_step =
        sane && step.norm() <= problem.options.relative_step * (1 + out.theta.norm());
    // Near the minimum the cost is flat to its last digit long before the gradient is. Its last
    // digit is that of a magnitude of 1 g, not of the residual, which six directions for six
    // constants leave thousands of times smaller.
    const double rounding = 1e-12 * out.cost + 2e-15 * std::sqrt(out.cost * weights);
    const bool improves = moved_cost < out.cost || (sane && moved_cost <= out.cost + rounding &&
                                                    moved_gradient.norm() <= gradient.norm());
    if (improves || small_step) {
      if (improves) {
        out.theta = moved;
        out.cost = moved_cost;
        gradient = moved_gradient;
        hessian = moved_hessian;
        damping = std::max(damping / 10, 1e-15);
      }
      const double steepest = steepest_cosine(gradient, hessian, std::max(out.cost, cost_floor));
      // Both, always: a small step alone is also what heavy damping makes, a flat gradient alone is
      // also what a long valley has.
      if (small_step && (steepest <= problem.options.relative_gradient || out.cost <= cost_floor)) {
        out.converged = true;
        break;
      }
    }
    if (!improves) {
      damping = std::max(damping * 10, 1e-12);
    }
    if (damping > 1e12) {
      break;
    }
  }
  return out;
}

// Cross-axis terms that have a prior.
int cross_axis_priors(const LeastSquaresOptions& options) {
  return options.model.cross_axis ? static_cast<int>(std::count_if(
                                        options.cross_axis_sd.begin(), options.cross_axis_sd.end(),
                                        [](double sd) { return sd > 0; }))
                                  : 0;
}

Status check_points(std::span<const GravityPoint> points, const Calibration& start,
                    const LeastSquaresOptions& options) {
  SIXPOINT_CHECK(validate(start));
  const auto needed =
      static_cast<std::size_t>(options.model.parameters() - cross_axis_priors(options));
  if (!options.prior && points.size() < needed) {
    return fail(ErrorCode::bad_data, "fewer directions than constants to determine",
                "least squares", "lay the unit still on more of its sides");
  }
  for (const GravityPoint& point : points) {
    const bool usable =
        all_finite(point.sigma_g, point.temperature_c, point.mean_lsb, point.variance_lsb2) &&
        point.sigma_g > 0 && std::ranges::min(point.variance_lsb2) >= 0;
    if (!usable) {
      return fail(ErrorCode::bad_data, "a still point is not a finite number", "least squares",
                  "the recording is damaged");
    }
  }
  if (options.prior) {
    SIXPOINT_CHECK(validate(options.prior->mean));
  }
  return {};
}

// The inverse of J'WJ, bounded where it is singular.
void set_covariance(const Matrix& hessian, LeastSquaresFit& fit) {
  constexpr double kSingular = 1e-16;  // of the largest eigenvalue
  const auto n = hessian.rows();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(hessian);
  const double largest = std::max(eigen.eigenvalues()[n - 1], 1e-300);
  Vector inverse(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    inverse[i] = 1 / std::max(eigen.eigenvalues()[i], largest * kSingular);
  }
  fit.condition = std::sqrt(largest / std::max(eigen.eigenvalues()[0], largest * kSingular));
  const Matrix covariance =
      eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      fit.covariance[static_cast<std::size_t>(i) * kMaxParameters + static_cast<std::size_t>(j)] =
          covariance(i, j);
    }
  }
}

// The lowest minimum; one that converged before one that did not.
const Descent& best_of(const std::vector<Descent>& descents) {
  return *std::min_element(descents.begin(), descents.end(),
                           [](const Descent& left, const Descent& right) {
                             if (left.converged != right.converged) {
                               return left.converged;
                             }
                             return left.cost < right.cost;
                           });
}

}  // namespace

Result<LeastSquaresFit> least_squares(std::span<const GravityPoint> points,
                                      const Calibration& start,
                                      const LeastSquaresOptions& options) {
  SIXPOINT_CHECK(check_points(points, start, options));
  Problem problem{points, start, options};
  const int n = problem.size();

  // A real sensor against its stored constants: gain 0.75 to 1.3, zero within 0.5 g. The norm has
  // mirror minima far away; these starts are near enough to the right one.
  constexpr std::array<std::array<double, 4>, 7> kStarts = {{{0, 0, 0, 0},
                                                             {-0.15, 0.1, 0.1, 0.1},
                                                             {0.15, -0.1, -0.1, -0.1},
                                                             {0, 0.3, -0.3, 0.3},
                                                             {0, -0.3, 0.3, -0.3},
                                                             {-0.1, 0.2, 0.2, -0.3},
                                                             {0.1, -0.2, 0.3, 0.2}}};
  std::vector<Descent> descents;
  const int starts = std::clamp(options.starts, 1, static_cast<int>(kStarts.size()));
  for (std::size_t k = 0; k < static_cast<std::size_t>(starts); ++k) {
    Vector theta = Vector::Zero(n);
    for (std::size_t a = 0; a < kAxes; ++a) {
      theta[static_cast<Eigen::Index>(a)] = kStarts[k][0];
      theta[static_cast<Eigen::Index>(3 + a)] = kStarts[k][1 + a];
    }
    descents.push_back(descend(problem, theta));
  }
  const Descent& best = best_of(descents);
  LeastSquaresFit fit;
  fit.model = options.model;
  fit.calibration = problem.calibration(best.theta);
  fit.iterations = best.iterations;
  fit.converged = best.converged && validate(fit.calibration).has_value();
  fit.starts = starts;
  for (const Descent& descent : descents) {
    fit.starts_in_basin += (descent.theta - best.theta).norm() < 1e-6 ? 1 : 0;
  }
  if (!validate(fit.calibration)) {
    fit.calibration = start;
    fit.converged = false;
    return fit;
  }
  Vector theta = Vector::Zero(n);
  theta.tail(n - 6) = best.theta.tail(n - 6);
  for (std::size_t k = 0; k < kAxes; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    if (options.model.cross_axis) {
      fit.cross_axis[k] = best.theta[6 + i];
    }
    if (options.model.temperature) {
      const auto j = problem.temperature_offset() + i;
      // In g by the start's sensitivity; the base changes below.
      fit.zero_lsb_per_c[k] = best.theta[j] / start.sensitivity_g_per_lsb[k];
      theta[j] = fit.zero_lsb_per_c[k] * fit.calibration.sensitivity_g_per_lsb[k];
    }
  }

  // About the solution as base, so that the covariance's entries are in g of the solution.
  problem.base = fit.calibration;
  Vector gradient(n);
  Matrix hessian(n, n);
  fit.chi2 = problem.evaluate(theta, gradient, hessian);
  set_covariance(hessian, fit);
  fit.degrees_of_freedom =
      static_cast<int>(points.size()) - n + (options.prior ? 6 : 0) + cross_axis_priors(options);
  double square = 0;
  for (const GravityPoint& point : points) {
    const double residual = magnitude_g(fit, point) - options.gravity_g;
    square += residual * residual;
  }
  fit.rms_mg =
      points.empty() ? 0 : kMgPerG * std::sqrt(square / static_cast<double>(points.size()));
  return fit;
}

ConstantsUncertainty LeastSquaresFit::standard_uncertainty() const {
  ConstantsUncertainty out;
  for (std::size_t a = 0; a < kAxes; ++a) {
    out.sensitivity_relative[a] = std::sqrt(std::max(0.0, covariance_at(a, a)));
    out.zero_mg[a] = kMgPerG * std::sqrt(std::max(0.0, covariance_at(3 + a, 3 + a)));
  }
  return out;
}

double LeastSquaresFit::variance_along(const std::array<double, 6>& slope) const {
  double variance = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      variance += slope[i] * slope[j] * covariance_at(i, j);
    }
  }
  return variance;
}

std::span<const PerAxis<double>> sphere_grid() {
  static const std::vector<PerAxis<double>> kGrid = [] {
    std::vector<PerAxis<double>> grid;
    for (int x = -2; x <= 2; ++x) {
      for (int y = -2; y <= 2; ++y) {
        for (int z = -2; z <= 2; ++z) {
          if (std::max({std::abs(x), std::abs(y), std::abs(z)}) == 2) {
            const double length = std::sqrt(x * x + y * y + z * z);
            grid.push_back({x / length, y / length, z / length});
          }
        }
      }
    }
    return grid;
  }();
  return kGrid;
}

double LeastSquaresFit::worst_direction_mg() const {
  double worst = 0;
  for (const PerAxis<double>& n : sphere_grid()) {
    worst = std::max(worst,
                     variance_along({n[0] * n[0], n[1] * n[1], n[2] * n[2], -n[0], -n[1], -n[2]}));
  }
  return kMgPerG * std::sqrt(worst);
}

double magnitude_g(const Calibration& calibration, const PerAxis<double>& mean_lsb,
                   const PerAxis<double>& variance_lsb2) {
  double square = 0;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double level = calibration.to_g(a, mean_lsb[a]);
    const double s = calibration.sensitivity_g_per_lsb[a];
    square += level * level + s * s * variance_lsb2[a];
  }
  return std::sqrt(square);
}

double magnitude_g(const LeastSquaresFit& fit, const GravityPoint& point) {
  PerAxis<double> u{};
  double square = 0;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double s = fit.calibration.sensitivity_g_per_lsb[a];
    u[a] = s * (point.mean_lsb[a] - fit.calibration.zero_lsb[a] -
                fit.zero_lsb_per_c[a] * point.temperature_c);
    square += s * s * point.variance_lsb2[a];
  }
  PerAxis<double> q = u;
  for (std::size_t k = 0; k < kAxes; ++k) {
    q[kPair[k][0]] += fit.cross_axis[k] * u[kPair[k][1]];
    q[kPair[k][1]] += fit.cross_axis[k] * u[kPair[k][0]];
  }
  return std::sqrt(square + q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
}

CalibrationDifference difference_over_sphere(const Calibration& a, const Calibration& b) {
  CalibrationDifference out;
  double square = 0;
  for (const PerAxis<double>& n : sphere_grid()) {
    double length = 0;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double raw = a.zero_lsb[axis] + n[axis] / a.sensitivity_g_per_lsb[axis];
      const double value = b.to_g(axis, raw);
      length += value * value;
    }
    const double off = kMgPerG * std::abs(std::sqrt(length) - 1);
    out.worst_mg = std::max(out.worst_mg, off);
    square += off * off;
  }
  out.rms_mg = std::sqrt(square / static_cast<double>(sphere_grid().size()));
  return out;
}

}  // namespace sixpoint::calib
