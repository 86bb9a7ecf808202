#include "calib/zero_drift.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "calib/least_squares.h"
#include "calib/still_blocks.h"

namespace sixpoint::calib {

namespace {

// Relative sensitivity, zero, cross-axis terms xy xz yz, zero's change to the end of the file.
constexpr int kConstants = 6;
constexpr int kRates = 9;
constexpr int kParameters = 12;
using Row = Eigen::Matrix<double, kParameters, 1>;
using DriftMatrix = Eigen::Matrix<double, kParameters, kParameters>;
using Head = Eigen::Matrix<double, kConstants, kConstants>;

// One uninterrupted stay on a side.
struct Visit {
  double blocks = 0;
  double time_s = 0;  // mean
  double error_g = 0;
  PerAxis<double> direction{};
  double square_s2 = 0;
  double product = 0;
  PerAxis<double> axis_product{};  // of each axis by itself
  int neighbourhood = 0;
};

// How neighbouring blocks scatter about their visit's own line: that a warm-up slows down from side
// to side is not noise.
struct Scatter {
  double left_g2 = 0;
  double neighbours_g2 = 0;
  double freedom = 0;
};

std::optional<Visit> visit_of(std::span<const DriftPoint> points, Scatter& scatter) {
  Visit visit;
  visit.blocks = static_cast<double>(points.size());
  visit.neighbourhood = points.front().direction;
  for (const DriftPoint& point : points) {
    visit.time_s += point.time_s / visit.blocks;
    visit.error_g += point.error_g / visit.blocks;
    for (std::size_t a = 0; a < kAxes; ++a) {
      visit.direction[a] += point.mean_g[a] / visit.blocks;
    }
  }
  const double length = std::hypot(visit.direction[0], visit.direction[1], visit.direction[2]);
  if (!(length > 0)) {
    return std::nullopt;
  }
  for (double& value : visit.direction) {
    value /= length;
  }
  for (const DriftPoint& point : points) {
    visit.square_s2 += std::pow(point.time_s - visit.time_s, 2);
    visit.product += (point.time_s - visit.time_s) * (point.error_g - visit.error_g);
    for (std::size_t a = 0; a < kAxes; ++a) {
      visit.axis_product[a] += (point.time_s - visit.time_s) * point.mean_g[a];
    }
  }
  if (points.size() < 3 || !(visit.square_s2 > 0)) {
    visit.square_s2 = 0;
    visit.product = 0;
    visit.axis_product = {};
    return visit;
  }
  double before = 0;
  for (const DriftPoint& point : points) {
    const double left = point.error_g - visit.error_g -
                        visit.product / visit.square_s2 * (point.time_s - visit.time_s);
    scatter.left_g2 += left * left;
    scatter.neighbours_g2 += left * before;
    before = left;
  }
  scatter.freedom += visit.blocks - 2;
  return visit;
}

// Variance of one block's magnitude, increased as usual for first order autocorrelation: a slow
// movement makes neighbouring blocks similar, and looks like a trend.
double block_variance_g2(const Scatter& scatter, const ZeroDriftOptions& options) {
  const double alike =
      scatter.left_g2 > 0 ? std::clamp(scatter.neighbours_g2 / scatter.left_g2, 0.0, 0.9) : 0;
  const double own = scatter.freedom > 0 ? scatter.left_g2 / scatter.freedom : 0;
  const double least = options.block_sd_g * options.block_sd_g;
  const double variance = scatter.freedom >= options.least_freedom ? own : std::max(own, least);
  return variance * (1 + alike) / (1 - alike) + 1e-14;
}

// What the level axes say of the rates, as information and its product with the rates (g and s).
// They measure a drift as well as upright axes, and there are four of them to two. But a unit that
// leans sinks a little, and what a drift makes in a minute is a hundredth of a degree. So their
// slopes are compared with how they scatter about a common rate, increased as F of 3 and n - 3
// degrees of freedom is wider than chi-square at one in 1000 (to 3 % between 9 and 100). They
// decide whether there is a drift and nothing else.
struct Level {
  Eigen::Vector3d information = Eigen::Vector3d::Zero();
  Eigen::Vector3d product = Eigen::Vector3d::Zero();
};
Level level_axes(std::span<const Visit> visits, const ZeroDriftOptions& options) {
  constexpr double kLevel = 0.5;
  Level out;
  double square_g2 = 0;
  int slopes = 0;
  for (const Visit& visit : visits) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      if (visit.blocks < options.level_blocks || !(std::abs(visit.direction[a]) < kLevel)) {
        continue;
      }
      const auto i = static_cast<Eigen::Index>(a);
      out.information[i] += visit.square_s2;
      out.product[i] += visit.axis_product[a];
      square_g2 += visit.axis_product[a] * visit.axis_product[a] / visit.square_s2;
      ++slopes;
    }
  }
  const double freedom = slopes - 3;
  if (freedom < options.least_level_freedom || !(out.information.minCoeff() > 0)) {
    return {};
  }
  const double common_g2 = (out.product.array().square() / out.information.array()).sum();
  const double scatter_g2 =
      (std::max(0.0, square_g2 - common_g2) / freedom + 1e-14) * std::exp(8.5 / freedom);
  out.information /= scatter_g2;
  out.product /= scatter_g2;
  return out;
}

// Slope of a visit's error in each parameter. For a constant, the parameter is how much it is too
// small.
Row row_of(const Visit& visit, double middle_s, double half_s) {
  const PerAxis<double>& n = visit.direction;
  Row row;
  row << n[0] * n[0], n[1] * n[1], n[2] * n[2], -n[0], -n[1], -n[2], 2 * n[0] * n[1],
      2 * n[0] * n[2], 2 * n[1] * n[2], 0, 0, 0;
  for (int a = 0; a < 3; ++a) {
    row[kRates + a] = n[static_cast<std::size_t>(a)] * (visit.time_s - middle_s) / half_s;
  }
  return row;
}

// The stays on the sides, in order of time.
struct Visits {
  std::vector<Visit> list;
  double middle_s = 0;  // mean time of the blocks
  double at_rest_s = 0;
  double block_g2 = 0;  // variance of one block's magnitude
};

Visits visits_of(std::span<const DriftPoint> points, const ZeroDriftOptions& options) {
  Visits out;
  Scatter scatter;
  const auto end_visit = [&](std::span<const DriftPoint> visit) {
    if (const auto made = visit_of(visit, scatter)) {
      out.list.push_back(*made);
      out.middle_s += made->time_s * made->blocks;
      for (const DriftPoint& point : visit) {
        out.at_rest_s += point.duration_s;
      }
    }
  };
  std::size_t begin = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    bool moved = false;
    for (std::size_t a = 0; a < kAxes; ++a) {
      moved = moved || !(std::abs(points[i].mean_g[a] - points[i - 1].mean_g[a]) <= kMoved_g);
    }
    if (moved) {
      end_visit(points.subspan(begin, i - begin));
      begin = i;
    }
  }
  end_visit(points.subspan(begin));
  out.middle_s /= static_cast<double>(points.size());
  out.block_g2 = block_variance_g2(scatter, options);
  return out;
}

// Between visits, those of one direction sharing its misfit (Woodbury), and along each visit, which
// holds information on the rates alone.
struct Information {
  DriftMatrix between = DriftMatrix::Zero();
  Row pull = Row::Zero();
  DriftMatrix along = DriftMatrix::Zero();
  Row along_pull = Row::Zero();
};

Information information_of(const Visits& visits, double half_s, const ZeroDriftOptions& options) {
  struct Shared {
    Row row = Row::Zero();
    double error = 0;
    double weight = 0;
  };
  Information out;
  std::map<int, Shared> directions;
  const double visit_g2 = options.visit_sd_g * options.visit_sd_g;
  for (const Visit& visit : visits.list) {
    const Row row = row_of(visit, visits.middle_s, half_s);
    const double weight = 1 / (visits.block_g2 / visit.blocks + visit_g2);
    out.between += weight * row * row.transpose();
    out.pull += weight * visit.error_g * row;
    Shared& shared = directions[visit.neighbourhood];
    shared.row += weight * row;
    shared.error += weight * visit.error_g;
    shared.weight += weight;
    for (int a = 0; a < 3; ++a) {
      const double n_a = visit.direction[static_cast<std::size_t>(a)];
      out.along_pull[kRates + a] += n_a * visit.product / half_s / visits.block_g2;
      for (int b = 0; b < 3; ++b) {
        out.along(kRates + a, kRates + b) += n_a * visit.direction[static_cast<std::size_t>(b)] *
                                             visit.square_s2 / (half_s * half_s) / visits.block_g2;
      }
    }
  }
  const double misfit_g2 = options.misfit_sd_g * options.misfit_sd_g;
  for (const auto& [number, shared] : directions) {
    const double share = misfit_g2 / (1 + misfit_g2 * shared.weight);
    out.between -= share * shared.row * shared.row.transpose();
    out.pull -= share * shared.error * shared.row;
  }
  constexpr double kSensorRange = 0.2;  // of sensitivity, and g of zero
  for (int i = 0; i < kParameters; ++i) {
    const double sd =
        i < kConstants ? kSensorRange
        : i < kRates
            ? std::max(1e-6, options.cross_axis_sd[static_cast<std::size_t>(i - kConstants)])
            : options.rate_sd_g;
    out.between(i, i) += 1 / (sd * sd);
  }
  return out;
}

// Against no drift: without the rates' prior, and with the level axes. A rate without any data
// keeps a little of the prior's information, so that all of them can be divided by.
double chi2_of(const Eigen::Matrix3d& rates, const Eigen::Vector3d& rate, const Level& level,
               double half_s_inverse, const ZeroDriftOptions& options) {
  const double prior = 1 / (options.rate_sd_g * options.rate_sd_g);
  Eigen::Matrix3d information = rates.inverse();
  const Eigen::Vector3d product = information * rate + level.product * half_s_inverse;
  information.diagonal().array() -= 0.99 * prior;
  information.diagonal() += level.information * (half_s_inverse * half_s_inverse);
  return product.dot(information.ldlt().solve(product));
}

// Standard deviation of the magnitude in the direction where it is largest.
double worst_sd_mg(const Head& covariance) {
  double worst = 0;
  for (const PerAxis<double>& n : sphere_grid()) {
    Eigen::Matrix<double, kConstants, 1> slope;
    slope << n[0] * n[0], n[1] * n[1], n[2] * n[2], -n[0], -n[1], -n[2];
    worst = std::max(worst, slope.dot(covariance * slope));
  }
  return kMgPerG * std::sqrt(worst);
}

Head hidden_of(const ZeroDrift& drift) {
  return Eigen::Map<const Eigen::Matrix<double, kConstants, kConstants, Eigen::RowMajor>>(
      drift.hidden.data());
}

Head allowance_of(const ZeroDrift& drift) {
  const Eigen::Map<const Eigen::Matrix<double, kConstants, 1>> apart(drift.apart.data());
  return hidden_of(drift) + apart * apart.transpose();
}

}  // namespace

double ZeroDrift::shown_mg() const {
  double square = 0;
  for (std::size_t a = 0; a < kAxes && shown; ++a) {
    square += std::pow(std::abs(half_span_mg[a]) + 1.645 * standard_uncertainty_mg[a], 2);
  }
  return std::sqrt(square);
}

double ZeroDrift::hidden_mg() const { return worst_sd_mg(hidden_of(*this)); }

double ZeroDrift::allowance_mg() const { return worst_sd_mg(allowance_of(*this)); }

PerAxis<double> ZeroDrift::sensitivity_relative() const {
  const Head covariance = allowance_of(*this);
  return {std::sqrt(std::max(0.0, covariance(0, 0))), std::sqrt(std::max(0.0, covariance(1, 1))),
          std::sqrt(std::max(0.0, covariance(2, 2)))};
}

PerAxis<double> ZeroDrift::zero_mg() const {
  const Head covariance = allowance_of(*this);
  PerAxis<double> out{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    const auto i = static_cast<Eigen::Index>(3 + a);
    out[a] = kMgPerG * std::sqrt(std::max(0.0, covariance(i, i)));
    if (shown) {
      out[a] = std::max(out[a], std::abs(half_span_mg[a]) + 1.645 * standard_uncertainty_mg[a]);
    }
  }
  return out;
}

std::optional<ZeroDrift> zero_drift(std::span<const DriftPoint> points,
                                    const ZeroDriftOptions& options) {
  if (points.empty()) {
    return std::nullopt;
  }
  ZeroDrift out;
  out.span_s = points.back().time_s - points.front().time_s;
  if (!(out.span_s > 0 && out.span_s <= options.most_span_s)) {
    return std::nullopt;
  }
  const Visits visits = visits_of(points, options);
  out.at_rest_s = visits.at_rest_s;
  out.within_s = out.span_s + points.back().duration_s;
  out.visits = static_cast<int>(visits.list.size());
  if (out.visits < 2) {
    return std::nullopt;
  }
  const double half_s = out.span_s / 2;
  const Information information = information_of(visits, half_s, options);
  const DriftMatrix with =
      (information.between + information.along).ldlt().solve(DriftMatrix::Identity());
  const Eigen::Matrix<double, kRates, kRates> without =
      information.between.topLeftCorner<kRates, kRates>().ldlt().solve(
          Eigen::Matrix<double, kRates, kRates>::Identity());
  const Row moved = with * (information.pull + information.along_pull);
  const Eigen::Matrix<double, kRates, 1> still = without * information.pull.head<kRates>();
  if (!with.allFinite() || !without.allFinite() || !moved.allFinite() || !still.allFinite()) {
    return std::nullopt;
  }
  const Head hidden = with.topLeftCorner<kConstants, kConstants>() -
                      without.topLeftCorner<kConstants, kConstants>();
  for (int i = 0; i < kConstants; ++i) {
    out.apart[static_cast<std::size_t>(i)] = moved[i] - still[i];
    for (int j = 0; j < kConstants; ++j) {
      out.hidden[static_cast<std::size_t>(i) * kConstants + static_cast<std::size_t>(j)] =
          hidden(i, j);
    }
  }
  const Eigen::Matrix3d rates = with.bottomRightCorner<3, 3>();
  const Eigen::Vector3d rate = moved.tail<3>();
  out.chi2 = chi2_of(rates, rate, level_axes(visits.list, options), 1 / half_s, options);
  out.shown = out.chi2 > options.least_chi2;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const auto i = static_cast<Eigen::Index>(a);
    out.half_span_mg[a] = kMgPerG * rate[i];
    out.standard_uncertainty_mg[a] = kMgPerG * std::sqrt(std::max(0.0, rates(i, i)));
  }
  return out;
}

}  // namespace sixpoint::calib
