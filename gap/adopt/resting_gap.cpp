#include "gap/adopt/resting_gap.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "gap/unguided/length_fit.h"

namespace sixpoint::gap {

namespace {

double length_error(const LengthFit& fit, const Eigen::Vector3d& raw) {
  return (fit.sensitivity * (raw - fit.zero)).norm() - 1;
}

// What the effects do to a specific force in the sensor, g.
Eigen::Vector3d added_by(const std::vector<sim::EffectSpec>& effects,
                         const Eigen::Vector3d& true_g) {
  sim::SimulatedBlock block;
  block.time_s = {0};
  block.motion.resize(1);
  block.true_g = {true_g};
  block.sensed_g = {true_g};
  block.temperature_c = {25};
  for (const auto& effect : sim::make_effects(effects, 1)) {
    effect->on_sensor(block);
  }
  return block.sensed_g.front() - true_g;
}

// Without those that were not at rest after all.
std::vector<Eigen::Vector3d> at_rest(const std::vector<Eigen::Vector3d>& means,
                                     const LengthFit& fit) {
  std::vector<double> sizes;
  sizes.reserve(means.size());
  for (const Eigen::Vector3d& mean : means) {
    sizes.push_back(std::abs(length_error(fit, mean)));
  }
  std::vector<double> sorted = sizes;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  constexpr double kMostPerMedian = 5 * 1.4826;  // of the size of a normal variable
  std::vector<Eigen::Vector3d> left;
  for (std::size_t i = 0; i < means.size(); ++i) {
    if (sizes[i] <= kMostPerMedian * *middle) {
      left.push_back(means[i]);
    }
  }
  return left;
}

}  // namespace

Result<RestingGap> resting_gap(const std::vector<RestingReading>& rests,
                               const std::vector<sim::EffectSpec>& effects) {
  std::vector<Eigen::Vector3d> means;
  means.reserve(rests.size());
  for (const RestingReading& rest : rests) {
    means.push_back(rest.mean);
  }
  SIXPOINT_ASSIGN(const LengthFit rough, fit_lengths(means, 1, CrossAxis::none));
  means = at_rest(means, rough);
  SIXPOINT_ASSIGN(const LengthFit own, fit_lengths(means, 1, CrossAxis::none));
  const Eigen::Matrix3d counts_per_g = own.sensitivity.inverse();
  for (Eigen::Vector3d& mean : means) {
    const Eigen::Vector3d direction = (own.sensitivity * (mean - own.zero)).normalized();
    mean -= counts_per_g * added_by(effects, direction);
  }
  SIXPOINT_ASSIGN(const LengthFit left, fit_lengths(means, 1, CrossAxis::none));
  double square = 0;
  for (const Eigen::Vector3d& mean : means) {
    square += std::pow(length_error(left, mean), 2) / static_cast<double>(means.size());
  }
  return RestingGap{1000 * std::sqrt(square), means.size()};
}

}  // namespace sixpoint::gap
