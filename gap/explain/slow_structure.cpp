#include "gap/explain/slow_structure.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace sixpoint::gap {
namespace {

// At least so many modes must be slow.
constexpr double kLeastModes = 8;
// Parameters that were fitted to the means (gains, offsets and more): modes that they used up.
constexpr double kFitted = 5;
// Log odds of each of the three other causes before the data, over the noise: a convention.
constexpr double kLogPriorOther = -2;
// Prior variances of the logarithm of an axis' variance: of noise, and of another cause.
constexpr double kAlikeVariance = 0.05;
constexpr double kUnlikeVariance = 4;

// Sums over modes: z is each axis' coefficient in units of what noise of the found size would give
// it, `weight` the share of that which is slow.
struct Sums {
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();  // sum of w z z'
  double weight = 0;
  double weight2 = 0;

  void add(const Eigen::Vector3d& z, double w) {
    products += w * z * z.transpose();
    weight += w;
    weight2 += w * w;
  }
  // Equivalent number of modes that are slow noise alone.
  double modes() const { return weight2 > 0 ? weight * weight / weight2 : 0; }
};

void add_records(const SlowNoise& records, Scatter scatter, double size, Sums& sums) {
  for (const SlowNoise::Mode& mode : records.modes) {
    const double slow_mg2 = scatter == Scatter::random_walk
                                ? size * size * mode.walk
                                : flicker_density_mg2(size) * mode.flicker;
    Eigen::Vector3d z;
    double weight = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const double variance = slow_mg2 + mode.white_mg2[a];
      z[static_cast<Eigen::Index>(a)] = mode.value_mg[a] / std::sqrt(variance);
      weight += slow_mg2 / variance / 3;
    }
    sums.add(z, weight);
  }
}

// The dwells' means: modes are the eigenvectors of the slow covariance over the white one.
void add_means(const std::vector<Block>& blocks, const Fit& fit, double lsb_mg, Sums& sums) {
  const auto n = static_cast<Eigen::Index>(blocks.size());
  if (n < 4) {
    return;
  }
  const double start_s = blocks.front().middle_s - blocks.front().seconds / 2;
  Eigen::MatrixXd slow(n, n);
  Eigen::MatrixXd left(n, 3);
  Eigen::MatrixXd white(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Block& block = blocks[static_cast<std::size_t>(i)];
    const Eigen::VectorXd off = block.value_mg - predict(fit.state, block, lsb_mg);
    for (Eigen::Index a = 0; a < 3; ++a) {
      left(i, a) = off[a];
      white(i, a) = nominal_variance_mg2(block, a) +
                    fit.seats_deg * fit.seats_deg * seating_lever(block).row(a).squaredNorm();
    }
    for (Eigen::Index j = 0; j < n; ++j) {
      slow(i, j) = fit.scatter_size * fit.scatter_size *
                   scatter_kernel(fit.scatter, block, blocks[static_cast<std::size_t>(j)], start_s);
    }
  }
  const Eigen::VectorXd common = white.rowwise().mean();
  const Eigen::VectorXd scale = common.cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(scale.asDiagonal() * slow *
                                                             scale.asDiagonal());
  const Eigen::MatrixXd along = modes.eigenvectors().transpose() * scale.asDiagonal() * left;
  const Eigen::Vector3d share = (white.array().colwise() / common.array()).colwise().mean();
  // The first modes hold little but the offset, which was fitted.
  for (Eigen::Index k = 0; k + 1 < n; ++k) {
    const double variance = std::max(0.0, modes.eigenvalues()[k]);
    Eigen::Vector3d z;
    double weight = 0;
    for (Eigen::Index a = 0; a < 3; ++a) {
      z[a] = along(k, a) / std::sqrt(variance + share[a]);
      weight += variance / (variance + share[a]) / 3;
    }
    sums.add(z, weight);
  }
}

}  // namespace

SlowStructure slow_structure(const std::vector<Block>& blocks, const Fit& fit,
                             const SlowNoise& records, double lsb_mg) {
  SlowStructure found;
  Sums sums;
  add_records(records, fit.scatter, fit.scatter_size, sums);
  add_means(blocks, fit, lsb_mg, sums);
  const double modes = sums.modes();
  found.jump_nats = records.jump_nats;
  if (modes > kLeastModes) {
    const Eigen::Vector3d sd = sums.products.diagonal().cwiseSqrt().cwiseMax(1e-12);
    const Eigen::Matrix3d correlation =
        sd.cwiseInverse().asDiagonal() * sums.products * sd.cwiseInverse().asDiagonal();
    // Three free correlations against none: likelihood ratio by the determinant, less the cost of
    // three free numbers (Schwarz's criterion).
    const double free_modes = modes - kFitted;
    found.in_step_nats = -0.5 * free_modes * std::log(std::max(1e-9, correlation.determinant())) -
                         1.5 * std::log(std::max(1.0, free_modes / (2 * M_PI)));
    // Sizes per axis: those of noise are about alike, those of another cause are not.
    const Eigen::Vector3d size =
        (sums.products.diagonal() / sums.weight).cwiseMax(1e-9).array().log();
    const double square = (size.array() - size.mean()).square().sum();
    const double like = 2 / modes + 2 / (modes * modes) + kAlikeVariance;
    const double unlike = like + kUnlikeVariance;
    found.unlike_nats = 0.5 * square * (1 / like - 1 / unlike) - std::log(unlike / like);
  }
  const std::array<std::pair<double, const char*>, 3> others = {
      {{found.in_step_nats, "several axes move in step, as no noise of a sensor does"},
       {found.unlike_nats, "one axis wanders and others do not"},
       {found.jump_nats, "the zero jumps, and rests between"}}};
  for (const auto& [nats, words] : others) {
    if (nats + kLogPriorOther > found.other_nats) {
      found.other_nats = nats + kLogPriorOther;
      found.other = words;
    }
  }
  return found;
}

}  // namespace sixpoint::gap
