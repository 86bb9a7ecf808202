#include "sim/simulator.h"

#include <cmath>

#include <gtest/gtest.h>

namespace sixpoint::sim {
namespace {

struct Moments {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d sd = Eigen::Vector3d::Zero();
};

Moments raw_moments(const SimulatedBlock& block) {
  Moments moments;
  const auto n = static_cast<double>(block.size());
  for (const auto& raw : block.raw_lsb) {
    moments.mean += Eigen::Vector3d(raw[0], raw[1], raw[2]) / n;
  }
  for (const auto& raw : block.raw_lsb) {
    moments.sd += (Eigen::Vector3d(raw[0], raw[1], raw[2]) - moments.mean).cwiseAbs2() / (n - 1);
  }
  moments.sd = moments.sd.cwiseSqrt();
  return moments;
}

// Oracle: closed form. Mean = sensitivity * g + zero; the standard deviation is that of the noise
// and of rounding (1/12 LSB^2), within five standard errors.
TEST(Simulator, ReadsTheSensorUnderTheChosenFilter) {
  const UnitTruth unit = draw_unit(5);
  const Eigen::Vector3d up = Eigen::Vector3d(0.3, -0.6, 0.9).normalized();
  const auto motion = still(rotation_with_up(up));
  for (const auto filter : {FilterConfiguration::legacy, FilterConfiguration::current}) {
    SimulatorOptions options;
    options.filter = filter;
    Simulator simulator(unit, options, *motion);
    SimulatedBlock block;
    simulator.next(20'000, block);
    const Moments moments = raw_moments(block);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const auto i = static_cast<Eigen::Index>(axis);
      const double sensitivity = unit.sensor(filter).sensitivity_lsb_per_g[axis];
      const double noise_lsb = unit.noise_mg[axis] / 1000 * sensitivity;
      const double sd = std::sqrt(noise_lsb * noise_lsb + 1.0 / 12);
      EXPECT_NEAR(moments.mean[i], sensitivity * up[i] + unit.sensor(filter).zero_lsb[axis],
                  5 * sd / std::sqrt(20'000.0) + 1e-3);
      EXPECT_NEAR(moments.sd[i], sd, 5 * sd / std::sqrt(40'000.0) + 2e-3);
    }
  }
}

TEST(Simulator, SameSeedSameCountsHoweverItIsCut) {
  const UnitTruth unit = draw_unit(5);
  const auto motion = free_living(60, 3);
  const auto again = free_living(60, 3);
  Simulator whole(unit, {}, *motion);
  Simulator parts(unit, {}, *again);
  SimulatedBlock all;
  whole.next(300, all);
  std::vector<gt3x::Counts> joined;
  SimulatedBlock block;
  for (const std::size_t count : {1U, 99U, 200U}) {
    parts.next(count, block);
    joined.insert(joined.end(), block.stored.begin(), block.stored.end());
  }
  EXPECT_EQ(joined, all.stored);
  SimulatorOptions other;
  other.seed = 2;
  Simulator different(unit, other, *motion);
  different.next(300, block);
  EXPECT_NE(block.stored, all.stored);
}

// Oracle: the raw count is an integer, so stored = round(scale * 2 / (p - n) * (raw - zero)).
TEST(Simulator, StoredFollowsFromRaw) {
  const UnitTruth unit = draw_unit(8);
  const auto motion = free_living(60, 3);
  Simulator simulator(unit, {}, *motion);
  SimulatedBlock block;
  simulator.next(1500, block);
  for (std::size_t i = 0; i < block.size(); ++i) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double range = unit.constants.positive_lsb[axis] - unit.constants.negative_lsb[axis];
      const double exact =
          256.0 * 2.0 * (block.raw_lsb[i][axis] - unit.constants.zero_lsb[axis]) / range;
      EXPECT_NEAR(block.stored[i][axis], std::clamp(exact, -2048.0, 2047.0), 0.5 + 1e-9);
    }
  }
}

}  // namespace
}  // namespace sixpoint::sim
