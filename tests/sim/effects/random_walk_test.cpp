#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using tests::made_block;
using tests::made_effect;

// The walk's steps in units of mg, with times every interval_s.
std::vector<Eigen::Vector3d> steps_mg(double interval_s, std::size_t count) {
  const auto effect = made_effect("random_walk", {{"mg_per_sqrt_s", {0.2}}});
  SimulatedBlock block = made_block(count + 1, 1 / interval_s);
  effect->on_sensor(block);
  std::vector<Eigen::Vector3d> steps;
  for (std::size_t i = 1; i < block.size(); ++i) {
    steps.emplace_back(1000 * (block.sensed_g[i] - block.sensed_g[i - 1]));
  }
  return steps;
}

// Oracle: Brownian motion. The variance of a step is mg_per_sqrt_s^2 times its duration, so it is
// the same law sample by sample and over a pause; steps do not depend on each other. Limits of five
// standard errors.
TEST(RandomWalk, TheVarianceOfAStepGrowsWithItsDuration) {
  constexpr std::size_t kSteps = 20'000;
  const double n = 3 * kSteps;
  for (const double interval_s : {0.01, 1.0, 60.0}) {
    double square = 0;
    double lagged = 0;
    Eigen::Vector3d before = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& step : steps_mg(interval_s, kSteps)) {
      square += step.squaredNorm() / n;
      lagged += step.dot(before) / n;
      before = step;
    }
    const double expected = 0.2 * 0.2 * interval_s;
    EXPECT_NEAR(square / expected, 1, 5 * std::sqrt(2 / n)) << interval_s;
    EXPECT_NEAR(lagged / expected, 0, 5 / std::sqrt(n)) << interval_s;
  }
}

TEST(RandomWalk, ItBeginsAtZeroAndTheAxesWalkByThemselves) {
  const auto effect = made_effect("random_walk");
  SimulatedBlock block = made_block(2);
  effect->on_sensor(block);
  EXPECT_EQ(block.sensed_g[0], Eigen::Vector3d(0, 0, 1));
  double product = 0;
  double square = 0;
  for (const Eigen::Vector3d& step : steps_mg(1, 20'000)) {
    product += step.x() * step.y();
    square += step.x() * step.x();
  }
  EXPECT_NEAR(product / square, 0, 5 / std::sqrt(20'000.0));
}

}  // namespace
}  // namespace sixpoint::sim
