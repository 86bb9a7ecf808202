#include "calib/zero_drift.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

namespace sixpoint::calib {

namespace {

// Relative sensitivity, zero, cross-axis terms xy xz yz, zero's change to the end of the file.
constexpr int kConstants = 6;
constexpr int kRates = 9;
constexpr int kParameters = 12;
using Row = Eigen::Matrix<double, kParameters, 1>;
using Matrix = Eigen::Matrix<double, kParameters, kParameters>;
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

// Variance of one block's magnitude, widened as usual for first order autocorrelation: a slow sway
// makes neighbours alike and a trend out of nothing.
double block_variance_g2(const Scatter& scatter, const ZeroDriftOptions& options) {
  const double alike =
      scatter.left_g2 > 0 ? std::clamp(scatter.neighbours_g2 / scatter.left_g2, 0.0, 0.9) : 0;
  const double own = scatter.freedom > 0 ? scatter.left_g2 / scatter.freedom : 0;
  const double least = options.block_sd_g * options.block_sd_g;
  const double variance = scatter.freedom >= options.least_freedom ? own : std::max(own, least);
  return variance * (1 + alike) / (1 - alike) + 1e-14;
}

// What the axes that lie level say of the rates, as information and its product with the rates (g
// and s). They see a drift as well as upright ones, and there are four of them to two; but a unit
// that leans sinks a little, and what a drift makes in a minute is a hundredth of a degree. So how
// their slopes scatter about a common rate is the yardstick, widened as F of 3 and n - 3 degrees of
// freedom is wider than chi-square at one in 1000 (to 3 % between 9 and 100). They are asked
// whether there is a drift and nothing else.
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

// d|q| by each parameter; for a constant, by what it is too small.
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

// The largest variance over a grid of directions, as LeastSquaresFit::worst_direction_mg() has it.
double worst_sd_mg(const Head& covariance) {
  double worst = 0;
  for (int x = -2; x <= 2; ++x) {
    for (int y = -2; y <= 2; ++y) {
      for (int z = -2; z <= 2; ++z) {
        if (std::max({std::abs(x), std::abs(y), std::abs(z)}) != 2) {
          continue;
        }
        Eigen::Matrix<double, 3, 1> n(x, y, z);
        n.normalize();
        Eigen::Matrix<double, kConstants, 1> pull;
        pull << n[0] * n[0], n[1] * n[1], n[2] * n[2], -n[0], -n[1], -n[2];
        worst = std::max(worst, pull.dot(covariance * pull));
      }
    }
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
  Scatter scatter;
  std::vector<Visit> visits;
  double middle_s = 0;
  const auto end_visit = [&](std::span<const DriftPoint> visit) {
    if (const auto made = visit_of(visit, scatter)) {
      visits.push_back(*made);
      middle_s += made->time_s * made->blocks;
      out.at_rest_s += visit.back().time_s - visit.front().time_s;
    }
  };
  std::size_t begin = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    bool moved = false;
    for (std::size_t a = 0; a < kAxes; ++a) {
      moved =
          moved || !(std::abs(points[i].mean_g[a] - points[i - 1].mean_g[a]) <= options.moved_g);
    }
    if (moved) {
      end_visit(points.subspan(begin, i - begin));
      begin = i;
    }
  }
  end_visit(points.subspan(begin));
  out.visits = static_cast<int>(visits.size());
  if (visits.size() < 2) {
    return std::nullopt;
  }
  middle_s /= static_cast<double>(points.size());
  const double half_s = out.span_s / 2;
  const double half_s_inverse = 1 / half_s;
  const double block_g2 = block_variance_g2(scatter, options);
  const double visit_g2 = options.visit_sd_g * options.visit_sd_g;

  // Information: between visits, those of one direction sharing its misfit (Woodbury), and along
  // each visit, which tells of the rates alone. Zero is to be small in all of it but for what a
  // real sensor has.
  Matrix information = Matrix::Zero();
  Row pull = Row::Zero();
  struct Shared {
    Row row = Row::Zero();
    double error = 0;
    double weight = 0;
  };
  std::map<int, Shared> directions;
  Matrix along = Matrix::Zero();
  Row along_pull = Row::Zero();
  for (const Visit& visit : visits) {
    const Row row = row_of(visit, middle_s, half_s);
    const double weight = 1 / (block_g2 / visit.blocks + visit_g2);
    information += weight * row * row.transpose();
    pull += weight * visit.error_g * row;
    Shared& shared = directions[visit.neighbourhood];
    shared.row += weight * row;
    shared.error += weight * visit.error_g;
    shared.weight += weight;
    for (int a = 0; a < 3; ++a) {
      const double n_a = visit.direction[static_cast<std::size_t>(a)];
      along_pull[kRates + a] += n_a * visit.product / half_s / block_g2;
      for (int b = 0; b < 3; ++b) {
        along(kRates + a, kRates + b) += n_a * visit.direction[static_cast<std::size_t>(b)] *
                                         visit.square_s2 / (half_s * half_s) / block_g2;
      }
    }
  }
  const double misfit_g2 = options.misfit_sd_g * options.misfit_sd_g;
  for (const auto& [number, shared] : directions) {
    const double share = misfit_g2 / (1 + misfit_g2 * shared.weight);
    information -= share * shared.row * shared.row.transpose();
    pull -= share * shared.error * shared.row;
  }
  constexpr double kSensorRange = 0.2;  // of sensitivity, and g of zero
  for (int i = 0; i < kParameters; ++i) {
    const double sd =
        i < kConstants ? kSensorRange
        : i < kRates
            ? std::max(1e-6, options.cross_axis_sd[static_cast<std::size_t>(i - kConstants)])
            : options.rate_sd_g;
    information(i, i) += 1 / (sd * sd);
  }
  const Matrix with = (information + along).ldlt().solve(Matrix::Identity());
  const Eigen::Matrix<double, kRates, kRates> without =
      information.topLeftCorner<kRates, kRates>().ldlt().solve(
          Eigen::Matrix<double, kRates, kRates>::Identity());
  const Row moved = with * (pull + along_pull);
  const Eigen::Matrix<double, kRates, 1> still = without * pull.head<kRates>();
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
  // Against no drift: without the rates' prior, and with the level axes. Rates that nothing tells
  // of keep a little of the prior's information, so that all of them can be divided by.
  const Eigen::Matrix3d rates = with.bottomRightCorner<3, 3>();
  const Eigen::Vector3d rate = moved.tail<3>();
  const Level level = level_axes(visits, options);
  const double prior = 1 / (options.rate_sd_g * options.rate_sd_g);
  Eigen::Matrix3d told = rates.inverse();
  const Eigen::Vector3d product = told * rate + level.product * half_s_inverse;
  told.diagonal().array() -= 0.99 * prior;
  told.diagonal() += level.information * (half_s_inverse * half_s_inverse);
  out.chi2 = product.dot(told.ldlt().solve(product));
  out.shown = out.chi2 > options.least_chi2;
  for (std::size_t a = 0; a < kAxes; ++a) {
    const auto i = static_cast<Eigen::Index>(a);
    out.half_span_mg[a] = kMgPerG * rate[i];
    out.standard_uncertainty_mg[a] = kMgPerG * std::sqrt(std::max(0.0, rates(i, i)));
  }
  return out;
}

}  // namespace sixpoint::calib
