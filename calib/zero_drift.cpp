#include "calib/zero_drift.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sixpoint::calib {

namespace {

using Matrix3 = std::array<std::array<double, 3>, 3>;

std::optional<Matrix3> inverse(const Matrix3& m) {
  const auto minor_of = [&](std::size_t i, std::size_t j) {
    const std::size_t r = (i + 1) % 3;
    const std::size_t s = (i + 2) % 3;
    const std::size_t c = (j + 1) % 3;
    const std::size_t d = (j + 2) % 3;
    return m[r][c] * m[s][d] - m[r][d] * m[s][c];
  };
  const double determinant =
      m[0][0] * minor_of(0, 0) + m[0][1] * minor_of(0, 1) + m[0][2] * minor_of(0, 2);
  // Positive semidefinite: as a share of the largest that these diagonals allow.
  if (!(determinant > 1e-9 * m[0][0] * m[1][1] * m[2][2])) {
    return std::nullopt;
  }
  Matrix3 out{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      out[j][i] = minor_of(i, j) / determinant;
    }
  }
  return out;
}

struct Sums {
  Matrix3 normal{};
  PerAxis<double> product{};
  // About each stretch's own line: that a warm-up slows down from side to side is not noise.
  double left_g2 = 0;
  double neighbours_g2 = 0;
  double freedom = 0;
  int stretches = 0;
};

void add_stretch(std::span<const DriftPoint> stretch, Sums& sums) {
  if (stretch.size() < 3) {
    return;
  }
  const auto n = static_cast<double>(stretch.size());
  DriftPoint mean;
  for (const DriftPoint& point : stretch) {
    mean.time_s += point.time_s / n;
    mean.error_g += point.error_g / n;
    for (std::size_t a = 0; a < kAxes; ++a) {
      mean.mean_g[a] += point.mean_g[a] / n;
    }
  }
  const double length = std::hypot(mean.mean_g[0], mean.mean_g[1], mean.mean_g[2]);
  double square_s2 = 0;
  double product = 0;
  for (const DriftPoint& point : stretch) {
    square_s2 += std::pow(point.time_s - mean.time_s, 2);
    product += (point.time_s - mean.time_s) * (point.error_g - mean.error_g);
  }
  if (!(length > 0) || !(square_s2 > 0)) {
    return;
  }
  for (std::size_t a = 0; a < kAxes; ++a) {
    sums.product[a] += mean.mean_g[a] / length * product;
    for (std::size_t b = 0; b < kAxes; ++b) {
      sums.normal[a][b] += mean.mean_g[a] * mean.mean_g[b] / (length * length) * square_s2;
    }
  }
  double before = 0;
  for (const DriftPoint& point : stretch) {
    const double left =
        point.error_g - mean.error_g - product / square_s2 * (point.time_s - mean.time_s);
    sums.left_g2 += left * left;
    sums.neighbours_g2 += left * before;
    before = left;
  }
  sums.freedom += n - 2;
  ++sums.stretches;
}

}  // namespace

double ZeroDrift::bound_mg(std::size_t axis) const {
  return significant[axis] ? std::abs(half_span_mg[axis]) + 1.645 * standard_uncertainty_mg[axis]
                           : 0;
}

double ZeroDrift::worst_mg() const { return std::hypot(bound_mg(0), bound_mg(1), bound_mg(2)); }

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
  Sums sums;
  std::size_t begin = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    bool moved = false;
    for (std::size_t a = 0; a < kAxes; ++a) {
      moved =
          moved || !(std::abs(points[i].mean_g[a] - points[i - 1].mean_g[a]) <= options.moved_g);
    }
    if (moved) {
      add_stretch(points.subspan(begin, i - begin), sums);
      begin = i;
    }
  }
  add_stretch(points.subspan(begin), sums);
  out.stretches = sums.stretches;
  const auto covariance = inverse(sums.normal);
  if (!covariance || sums.freedom < options.least_freedom) {
    return std::nullopt;
  }
  // A slow sway makes neighbours alike and a trend out of nothing: the usual widening for first
  // order autocorrelation.
  const double alike =
      sums.left_g2 > 0 ? std::clamp(sums.neighbours_g2 / sums.left_g2, 0.0, 0.9) : 0;
  const double variance_g2 = sums.left_g2 / sums.freedom * (1 + alike) / (1 - alike) + 1e-14;
  const double half_mg = kMgPerG * out.span_s / 2;
  for (std::size_t a = 0; a < kAxes; ++a) {
    double rate = 0;
    for (std::size_t b = 0; b < kAxes; ++b) {
      rate += (*covariance)[a][b] * sums.product[b];
    }
    out.half_span_mg[a] = half_mg * rate;
    out.standard_uncertainty_mg[a] =
        half_mg * std::sqrt(variance_g2 * std::max(0.0, (*covariance)[a][a]));
    out.significant[a] =
        std::abs(out.half_span_mg[a]) > options.least_t * out.standard_uncertainty_mg[a];
  }
  return out;
}

}  // namespace sixpoint::calib
