// The forward model against closed forms.
#include "gap/explain/forward.h"

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

Block dwell(const Eigen::Matrix3d& rotation) {
  Block block;
  block.rotation = rotation;
  block.value_mg = Eigen::VectorXd::Zero(3);
  block.middle_s = 1800;
  block.seconds = 10;
  return block;
}

Block tone(double amplitude_g) {
  Block block;
  block.tone = true;
  block.axis = 2;
  block.harmonics = true;
  block.vibration_lab_g = amplitude_g * Eigen::Vector3d::UnitZ();
  block.value_mg = Eigen::VectorXd::Zero(8);
  return block;
}

constexpr double kLsb_mg = 1000.0 / 256;

TEST(Forward, GainOffsetDriftAndTemperature) {
  ForwardState s;
  s.gain = {1.1, 1, 1};
  s.offset_mg = {5, 0, 0};
  s.drift_mg_per_h = {4, 0, 0};
  s.tempco_mg_per_c = {0.5, 0, 0};
  Block block = dwell(Eigen::Matrix3d::Identity());
  block.temperature_c = 35;
  const Eigen::VectorXd y = predict(s, block, kLsb_mg);
  EXPECT_NEAR(y[0], 1.1 * (2 + 5) + 5, 1e-9);
  EXPECT_NEAR(y[2], 1000, 1e-9);
}

TEST(Forward, TiltTurnsGravityInTheLaboratory) {
  ForwardState s;
  s.tilt_deg = {0.1, 0};
  // Turned by 0.1 deg about x: z leans to -y by sin 0.1 deg.
  const Eigen::VectorXd y = predict(s, dwell(Eigen::Matrix3d::Identity()), kLsb_mg);
  EXPECT_NEAR(y[1], -1000 * std::sin(0.1 * M_PI / 180), 1e-6);
  EXPECT_NEAR(y[2], 1000 * std::cos(0.1 * M_PI / 180), 1e-6);
}

TEST(Forward, CubicMakesCompressionAndThirdHarmonic) {
  ForwardState s;
  s.third_mg_per_g3 = {0, 0, 0.08};
  Block block = tone(6);
  block.gravity_lab_g.setZero();
  const Eigen::VectorXd y = predict(s, block, kLsb_mg);
  EXPECT_NEAR(y[5], 6000 + 0.75 * 0.08 * 216, 1e-6);  // (3/4) K A^3
  EXPECT_NEAR(y[7], 0.25 * 0.08 * 216, 1e-6);         // (1/4) K A^3
  EXPECT_NEAR(y[6], 0, 1e-9);
}

TEST(Forward, SquareRectifies) {
  ForwardState s;
  s.second_mg_per_g2 = {0, 0, 0.4};
  const Eigen::VectorXd y = predict(s, tone(2), kLsb_mg);
  EXPECT_NEAR(y[2], 1000 + 0.4 * (1 + 2), 1e-6);  // g^2 + A^2 / 2
  EXPECT_NEAR(y[5], 2000 + 2 * 0.4 * 2, 1e-6);    // 2 K g A
  EXPECT_NEAR(y[6], 0.4 * 2, 1e-6);               // K A^2 / 2
}

// The filter stands behind the sensor: it takes from the tone that the curve has changed, and not
// from what the curve rectifies.
TEST(Forward, AFilterTakesFromTheToneOnly) {
  ForwardState s;
  s.second_mg_per_g2 = {0, 0, 0.4};
  s.third_mg_per_g3 = {0, 0, 0.08};
  Block block = tone(2);
  block.filter_gain = 0.6;
  const Eigen::VectorXd y = predict(s, block, kLsb_mg);
  EXPECT_NEAR(y[2], 1000 + 0.4 * (1 + 2) + 0.08 * (1 + 1.5 * 4), 1e-6);  // as without
  EXPECT_NEAR(y[5], 0.6 * (2000 + 2 * 0.4 * 2 + 0.08 * (3 * 2 + 0.75 * 8)), 1e-6);
  EXPECT_NEAR(seating_lever(block)(3, 1), 0.6 * 2000 * M_PI / 180, 1e-9);
  EXPECT_NEAR(seating_loss(block)[5], 0.6 * 500 * 2, 1e-9);
}

TEST(Forward, TruncationFollowsTheErrorFunction) {
  const double taken_mg = kLsb_mg / 2 * std::erf(2 / (4 * M_SQRT2));
  EXPECT_NEAR(truncated_mg(2 - taken_mg, 4, kLsb_mg), taken_mg, 1e-9);
  EXPECT_NEAR(truncated_mg(taken_mg - 2, 4, kLsb_mg), -taken_mg, 1e-9);
  EXPECT_NEAR(truncated_mg(1000, 4, kLsb_mg), kLsb_mg / 2, 1e-9);
  EXPECT_EQ(truncated_mg(0, 0.1, kLsb_mg), 0);

  ForwardState s;
  s.truncation = 1;
  s.offset_mg = {2, 0, 0};
  Block block = dwell(Eigen::Matrix3d::Identity());
  block.truncated_mg = {taken_mg, 0, kLsb_mg / 2};
  const Eigen::VectorXd y = predict(s, block, kLsb_mg);
  EXPECT_NEAR(y[0], 2 - taken_mg, 1e-9);
  EXPECT_NEAR(y[2], 1000 - kLsb_mg / 2, 1e-9);
}

TEST(Forward, SeatingLeverIsTheDerivativeOfASmallTurn) {
  const Block block = tone(0.5);
  const Eigen::MatrixXd lever = seating_lever(block);
  ForwardState s;
  const double small = 1e-4;
  for (int k = 0; k < 3; ++k) {
    s.misalignment_deg = small * Eigen::Vector3d::Unit(k);
    const Eigen::VectorXd change =
        (predict(s, block, kLsb_mg) - predict({}, block, kLsb_mg)) / small;
    EXPECT_NEAR((change.head<6>() - lever.col(k).head<6>()).norm(), 0, 0.01);
  }
}

// A tilt of 1 deg about X takes 1 - cos 1 deg off the axis along gravity.
TEST(Forward, SeatingLossIsTheSecondOrderOfATurn) {
  const Block block = dwell(Eigen::Matrix3d::Identity());
  const double turn = M_PI / 180;
  EXPECT_NEAR((turn * turn * seating_loss(block))[2], 1000 * (1 - std::cos(turn)), 1e-4);
  EXPECT_NEAR((turn * turn * seating_loss(tone(6)))[5], 6000 * (1 - std::cos(turn)), 1e-3);
}

TEST(Forward, TempcosAndWarmUpBend) {
  ForwardState s;
  s.tempco_cubic_mg_per_c3 = {1e-3, 0, 0};
  s.sensitivity_curve_percent_per_c2 = {0, 0, 1e-3};
  s.sensitivity_cubic_percent_per_c3 = {0, 0, 1e-4};
  s.quick_warm_up_mg = {0, 4, 0};
  Block block = dwell(Eigen::Matrix3d::Identity());
  block.temperature_c = 35;
  block.middle_s = s.warm_up_tau_s / 4;
  const Eigen::VectorXd y = predict(s, block, kLsb_mg);
  EXPECT_NEAR(y[0], 1, 1e-9);                         // 10^3 of it
  EXPECT_NEAR(y[1], 4 * std::exp(-1), 2e-3);          // the block has a length
  EXPECT_NEAR(y[2], 1000 * (1 + 1e-3 + 1e-3), 1e-9);  // 10^2 and 10^3 of it, in per cent
}

// Three blocks of a recording of two hours: at a quarter of it the sine of one period is 1, the
// cosine of two is -1.
// Oracle: the simulator's law, exp(-max(0, t) / tau) (sim/effects/warm_up.cpp), averaged over the block
// by a sum of small steps. Times are since power-on, and a protocol may have them before it.
TEST(Forward, AWarmUpBeginsAtPowerOnAndStaysFinite) {
  struct Case {
    double middle_s, seconds;
  };
  ForwardState s;
  s.warm_up_mg = {4, 0, 0};
  s.quick_warm_up_mg = {0, 1, 0};
  s.warm_up_tau_s = 75;
  for (const Case& c : {Case{-12'000, 10}, Case{-1e9, 10}, Case{2, 10}, Case{-4, 10}, Case{100, 0},
                        Case{200, 10}, Case{34'500, 69'000}, Case{1e9, 10}}) {
    Block block = dwell(Eigen::Matrix3d::Identity());
    block.middle_s = c.middle_s;
    block.seconds = c.seconds;
    const auto mean = [&](double tau_s) {
      constexpr int kSteps = 500'000;
      double sum = 0;
      for (int k = 0; k < kSteps; ++k) {
        const double t_s = c.middle_s + c.seconds * ((k + 0.5) / kSteps - 0.5);
        sum += std::exp(-std::max(0.0, t_s) / tau_s) / kSteps;
      }
      return sum;
    };
    const Eigen::VectorXd y = predict(s, block, kLsb_mg);
    EXPECT_NEAR(y[0], 4 * mean(75), 1e-6) << c.middle_s;
    EXPECT_NEAR(y[1], mean(75.0 / 4), 1e-6) << c.middle_s;
  }
}

TEST(Forward, ADriftRipples) {
  std::vector<Block> blocks(3, dwell(Eigen::Matrix3d::Identity()));
  blocks[0].middle_s = 600;
  blocks[1].middle_s = 600 + 1800;
  blocks[2].middle_s = 600 + 7200;
  set_ripples(blocks);
  ForwardState s;
  s.drift_ripple_mg_per_h.col(0) = Eigen::Vector3d(0.5, 0, 0);
  s.drift_ripple_mg_per_h.col(3) = Eigen::Vector3d(0, 0.25, 0);
  const auto added = [&](const Block& block) -> Eigen::VectorXd {
    return predict(s, block, kLsb_mg) - predict({}, block, kLsb_mg);
  };
  EXPECT_NEAR(added(blocks[1])[0], 2 * 0.5, 1e-9);
  EXPECT_NEAR(added(blocks[1])[1], -2 * 0.25, 1e-9);
  EXPECT_NEAR(added(blocks[2])[0], 0, 1e-9);
  EXPECT_NEAR(added(blocks[2])[1], 2 * 0.25, 1e-9);
  EXPECT_NEAR(added(blocks[2])[2], 0, 1e-9);
}

TEST(Forward, EveryParameterHasItsPlace) {
  ForwardState s;
  for (int p = 0; p < kForwardParameters; ++p) {
    parameter(s, p) = 100 + p;
  }
  for (int p = 0; p < kForwardParameters; ++p) {
    EXPECT_EQ(parameter(s, p), 100 + p) << p;
  }
  for (const ParameterGroup& group : parameter_groups()) {
    EXPECT_LE(group.first + group.count, kForwardParameters) << group.effect;
  }
}

}  // namespace
}  // namespace sixpoint::gap
