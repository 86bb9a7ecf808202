// Modes made by hand: noise of the found size, axes in step, one axis alone.
#include "gap/explain/slow_structure.h"

#include <random>

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

constexpr double kSize = 0.2;  // mg/sqrt(s)

// Coefficients of a walk of kSize that is far above the white noise. `mix`: what the axes get of
// three independent numbers of unit variance.
SlowNoise modes_of(const Eigen::Matrix3d& mix) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  SlowNoise records;
  for (int k = 0; k < 60; ++k) {
    SlowNoise::Mode mode;
    mode.walk = 100;
    mode.white_mg2 = {0.01, 0.01, 0.01};
    const Eigen::Vector3d z = mix * Eigen::Vector3d(normal(random), normal(random), normal(random));
    for (std::size_t a = 0; a < 3; ++a) {
      mode.value_mg[a] = kSize * std::sqrt(mode.walk) * z[static_cast<Eigen::Index>(a)];
    }
    records.modes.push_back(mode);
  }
  return records;
}

SlowStructure structure_of(const SlowNoise& records) {
  Fit fit;
  fit.scatter = Scatter::random_walk;
  fit.scatter_size = kSize;
  return slow_structure({}, fit, records, 3.90625);
}

TEST(SlowStructure, IndependentAxesAreNoise) {
  const SlowStructure found = structure_of(modes_of(Eigen::Matrix3d::Identity()));
  EXPECT_LT(found.other_nats, 0);
  EXPECT_LT(found.in_step_nats, 1);
  EXPECT_LT(found.unlike_nats, 1);
}

// With correlation r of two axes the likelihood ratio is -(n/2) ln(1 - r^2).
TEST(SlowStructure, AxesInStepAreNot) {
  Eigen::Matrix3d mix = Eigen::Matrix3d::Identity();
  mix.row(1) << 0.8, 0.6, 0;
  const SlowStructure found = structure_of(modes_of(mix));
  const double cost = 1.5 * std::log(55 / (2 * M_PI));
  EXPECT_NEAR(found.in_step_nats, -55 / 2.0 * std::log(1 - 0.64) - cost, 10);
  EXPECT_GT(found.other_nats, 10);
  EXPECT_NE(found.other.find("in step"), std::string::npos);
}

TEST(SlowStructure, OneAxisThatWandersAloneIsNot) {
  const SlowStructure found = structure_of(modes_of(Eigen::Vector3d(3, 0.05, 0.05).asDiagonal()));
  EXPECT_GT(found.unlike_nats, 3);
  EXPECT_NE(found.other.find("one axis"), std::string::npos);
}

TEST(SlowStructure, JumpsCompete) {
  SlowNoise records = modes_of(Eigen::Matrix3d::Identity());
  records.jump_nats = 9;
  EXPECT_NEAR(structure_of(records).other_nats, 7, 1e-12) << "prior odds are e^-2";
}

TEST(SlowStructure, FewModesSayNothing) {
  SlowNoise records = modes_of(Eigen::Matrix3d::Ones());
  records.modes.resize(7);
  EXPECT_EQ(structure_of(records).in_step_nats, 0);
}

}  // namespace
}  // namespace sixpoint::gap
