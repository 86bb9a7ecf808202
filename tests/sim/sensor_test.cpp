#include "sim/sensor.h"

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

namespace sixpoint::sim {
namespace {

UnitTruth made_unit() {
  UnitTruth unit;
  unit.legacy = {{250, 260, 270}, {10, -20, 30}};
  unit.current = {{200, 210, 220}, {50, 60, -70}};
  return unit;
}

Sensor quiet_sensor(const UnitTruth& unit, FilterConfiguration filter) {
  UnitTruth quiet = unit;
  quiet.noise_mg = {};
  return {quiet, filter, Random(1)};
}

// Oracle: sensitivity times acceleration plus zero, by hand.
TEST(Sensor, EachConfigurationHasItsOwnSensitivityAndZero) {
  Sensor legacy = quiet_sensor(made_unit(), FilterConfiguration::legacy);
  EXPECT_EQ(legacy.read({0, 0, 0}), (PerAxis<int>{10, -20, 30}));
  EXPECT_EQ(legacy.read({1, -1, 0.5}), (PerAxis<int>{260, -280, 165}));
  Sensor current = quiet_sensor(made_unit(), FilterConfiguration::current);
  EXPECT_EQ(current.read({0, 0, 0}), (PerAxis<int>{50, 60, -70}));
  EXPECT_EQ(current.read({1, -1, 0.5}), (PerAxis<int>{250, -150, 40}));
}

TEST(Sensor, ReadingsAreRoundedToTheNearestCount) {
  UnitTruth unit;
  unit.current = {{100, 100, 100}, {0, 0, 0.25}};
  Sensor sensor = quiet_sensor(unit, FilterConfiguration::current);
  EXPECT_EQ(sensor.read({0.0149, -0.0149, 0.0}), (PerAxis<int>{1, -1, 0}));
  EXPECT_EQ(sensor.read({0.0151, -0.0151, 0.003}), (PerAxis<int>{2, -2, 1}));
}

// Oracle: the ADXL362's 12 bits, -2048 to 2047.
TEST(Sensor, ReadingsAreClippedToTwelveBits) {
  UnitTruth unit;
  unit.current = {{1, 1, 1}, {0, 0, 0}};
  Sensor sensor = quiet_sensor(unit, FilterConfiguration::current);
  EXPECT_EQ(sensor.read({2046.4, 2046.6, 2047.4}), (PerAxis<int>{2046, 2047, 2047}));
  EXPECT_EQ(sensor.read({2047.6, 2048, 1e9}), (PerAxis<int>{2047, 2047, 2047}));
  EXPECT_EQ(sensor.read({-2046.6, -2047.6, -2048.6}), (PerAxis<int>{-2047, -2048, -2048}));
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(sensor.read({-1e9, -kInfinity, kInfinity}), (PerAxis<int>{-2048, -2048, 2047}));
}

TEST(Sensor, AUnitWithoutNoiseFeelsWhatActs) {
  Sensor sensor = quiet_sensor(made_unit(), FilterConfiguration::current);
  Eigen::Vector3d sensed_g(0.25, -1, 3);
  sensor.add_noise(sensed_g);
  EXPECT_EQ(sensed_g, Eigen::Vector3d(0.25, -1, 3));
}

TEST(Sensor, TheSameStreamGivesTheSameNoise) {
  Sensor first(made_unit(), FilterConfiguration::current, Random(7, 1));
  Sensor again(made_unit(), FilterConfiguration::current, Random(7, 1));
  Sensor other(made_unit(), FilterConfiguration::current, Random(7, 2));
  for (int i = 0; i < 10; ++i) {
    Eigen::Vector3d a(0, 0, 1);
    Eigen::Vector3d b = a;
    Eigen::Vector3d c = a;
    first.add_noise(a);
    again.add_noise(b);
    other.add_noise(c);
    EXPECT_EQ(a, b);
    EXPECT_NE(a, c);
  }
}

// Oracle: the moments of white Gaussian noise of 4, 4 and 8 mg; limits of five standard errors.
TEST(Sensor, NoiseIsWhiteAndGaussianOfTheUnitsSize) {
  constexpr std::size_t kSamples = 40'000;
  const double n = static_cast<double>(kSamples);
  UnitTruth unit = made_unit();
  unit.noise_mg = {4, 4, 8};
  Sensor sensor(unit, FilterConfiguration::legacy, Random(3));
  std::vector<Eigen::Vector3d> z(kSamples);  // in standard deviations
  for (Eigen::Vector3d& sample : z) {
    sample = Eigen::Vector3d(0, 0, 1);
    sensor.add_noise(sample);
    sample = (sample - Eigen::Vector3d(0, 0, 1)).cwiseQuotient(Eigen::Vector3d(4, 4, 8)) * 1000;
  }
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d square = mean;
  Eigen::Vector3d fourth = mean;
  Eigen::Vector3d lagged = mean;
  Eigen::Vector3d between = mean;
  for (std::size_t i = 0; i < kSamples; ++i) {
    mean += z[i] / n;
    square += z[i].cwiseAbs2() / n;
    fourth += z[i].cwiseAbs2().cwiseAbs2() / n;
    lagged += i > 0 ? Eigen::Vector3d(z[i].cwiseProduct(z[i - 1]) / n) : Eigen::Vector3d::Zero();
    between += z[i].cwiseProduct(Eigen::Vector3d(z[i].y(), z[i].z(), z[i].x())) / n;
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(mean[axis], 0, 5 / std::sqrt(n));
    EXPECT_NEAR(square[axis], 1, 5 * std::sqrt(2 / n));
    EXPECT_NEAR(fourth[axis], 3, 5 * std::sqrt(96 / n));
    EXPECT_NEAR(lagged[axis], 0, 5 / std::sqrt(n)) << "one sample says nothing of the next";
    EXPECT_NEAR(between[axis], 0, 5 / std::sqrt(n)) << "nor one axis of another";
  }
}

}  // namespace
}  // namespace sixpoint::sim
