#include "gap/unguided/length_fit.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "calib/least_squares.h"

namespace sixpoint::gap {

namespace {

// Readings are scaled to this many counts per g, as a real sensor has them.
constexpr double kCountsPerG = 256;

tl::unexpected<Error> not_spanning() {
  return fail(ErrorCode::bad_data, "the positions do not span all directions", {},
              "rest the unit on every side");
}

}  // namespace

Result<LengthFit> fit_lengths(const std::vector<Eigen::Vector3d>& raw, double gravity,
                              CrossAxis cross_axis) {
  if (raw.size() < 12 || !(gravity > 0)) {
    return fail(ErrorCode::bad_data, "fewer than twelve positions", {},
                "rest the unit in more directions");
  }
  Eigen::Vector3d low = raw.front();
  Eigen::Vector3d high = raw.front();
  for (const Eigen::Vector3d& r : raw) {
    low = low.cwiseMin(r);
    high = high.cwiseMax(r);
  }
  if (!((high - low).minCoeff() > 0)) {
    return not_spanning();
  }
  // In the middle of its extremes each axis is about 0, at either end about 1 g.
  const Eigen::Vector3d middle = 0.5 * (low + high);
  const Eigen::Vector3d counts = 2 * kCountsPerG * (high - low).cwiseInverse();
  std::vector<calib::GravityPoint> points;
  points.reserve(raw.size());
  for (const Eigen::Vector3d& r : raw) {
    const Eigen::Vector3d scaled = counts.cwiseProduct(r - middle);
    points.push_back({{scaled[0], scaled[1], scaled[2]}, {}, 1, 0});
  }
  calib::Calibration start;
  start.sensitivity_g_per_lsb.fill(1 / kCountsPerG);
  calib::LeastSquaresOptions options;
  options.model.cross_axis = cross_axis == CrossAxis::symmetric;
  options.starts = 1;
  const auto found = calib::least_squares(points, start, options);
  if (!found || !found->converged) {
    return not_spanning();
  }
  // Back to the readings' unit: |G (raw - zero)| = gravity, where G is known but for a rotation.
  // The symmetric one is the root of G'G.
  const auto& [xy, xz, yz] = found->cross_axis;
  const Eigen::Map<const Eigen::Vector3d> gain(found->calibration.sensitivity_g_per_lsb.data());
  const Eigen::Map<const Eigen::Vector3d> zero(found->calibration.zero_lsb.data());
  Eigen::Matrix3d g;
  g << 1, xy, xz, xy, 1, yz, xz, yz, 1;
  g = gravity * g * gain.cwiseProduct(counts).asDiagonal();
  LengthFit fit;
  fit.sensitivity =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(g.transpose() * g).operatorSqrt();
  fit.zero = middle + zero.cwiseQuotient(counts);
  fit.residual = gravity * found->rms_mg / kMgPerG;
  const Eigen::Matrix3d& s = fit.sensitivity;
  const auto n = static_cast<double>(raw.size());
  const double sd =
      found->rms_mg / kMgPerG * std::sqrt(n / std::max(1.0, n - 9));  // of one position, in g
  for (Eigen::Index k = 0; k < 3; ++k) {
    const Eigen::Index i = k == 0 ? 1 : 0;
    const Eigen::Index j = k == 2 ? 1 : 2;
    fit.cross[k] = 2 * s(i, j) / (s(i, i) + s(j, j));
    const auto term = static_cast<std::size_t>(8 - k);  // the fit has xy xz yz
    // To first order, the symmetric form of a term between axes of unequal gain is this much less.
    const double less = 4 * s(i, i) * s(j, j) / std::pow(s(i, i) + s(j, j), 2);
    fit.cross_sd[k] = less * sd * std::sqrt(found->covariance_at(term, term));
  }
  return fit;
}

}  // namespace sixpoint::gap
