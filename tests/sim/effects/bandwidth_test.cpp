#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

std::unique_ptr<Effect> low_pass(double corner_hz, int order) {
  auto effect = made_effect("bandwidth",
                            {{"corner_hz", {corner_hz}}, {"order", {static_cast<double>(order)}}});
  RecordingPlan plan;
  plan.rate_hz = 100;
  effect->on_recording(plan);
  return effect;
}

// Oracle: the Butterworth law under the bilinear transform with its corner kept in place:
// |H(f)|^2 = 1 / (1 + (tan(pi f / rate) / tan(pi corner / rate))^(2 order)).
TEST(Bandwidth, TheResponseIsThatOfAButterworthLowPass) {
  for (const double corner_hz : {5.0, 12.5, 25.0, 40.0}) {
    for (int order = 1; order <= 8; ++order) {
      const auto effect = low_pass(corner_hz, order);
      SimulatedBlock block = made_block(4000);
      block.sensed_g.assign(block.size(), Eigen::Vector3d::Zero());
      block.sensed_g[1] = {1, 0, -2};  // the first sample finds the filter at rest
      effect->on_analog(block);
      for (const double frequency_hz : {0.5, 2.0, 5.0, 10.0, 20.0, 35.0, 49.0}) {
        std::complex<double> x = 0;
        std::complex<double> z = 0;
        for (std::size_t i = 1; i < block.size(); ++i) {
          const auto turn = std::polar(
              1.0, -2 * std::numbers::pi * frequency_hz * (static_cast<double>(i) - 1) / 100);
          x += block.sensed_g[i].x() * turn;
          z += block.sensed_g[i].z() * turn;
        }
        const double ratio = std::tan(std::numbers::pi * frequency_hz / 100) /
                             std::tan(std::numbers::pi * corner_hz / 100);
        const double expected = 1 / std::sqrt(1 + std::pow(ratio, 2 * order));
        EXPECT_NEAR(std::abs(x), expected, 1e-9) << corner_hz << " " << order;
        EXPECT_NEAR(std::abs(z), 2 * expected, 2e-9) << corner_hz << " " << order;
      }
    }
  }
}

// Oracle: unity gain at zero frequency. After a pause the filter has settled on the new pose;
// without a pause the first sample keeps most of the old one.
TEST(Bandwidth, ARestIsLeftAsItIs) {
  const auto effect = low_pass(10, 4);
  SimulatedBlock block = made_block(50);
  effect->on_analog(block);
  for (const Eigen::Vector3d& sensed : block.sensed_g) {
    EXPECT_NEAR(sensed.z(), 1, 1e-12);
  }
  Placement after_a_pause;
  after_a_pause.contiguous = false;
  effect->on_placement(after_a_pause);
  block.sensed_g.assign(block.size(), Eigen::Vector3d(-0.6, 0.8, 0));
  effect->on_analog(block);
  EXPECT_NEAR(block.sensed_g[0].x(), -0.6, 1e-12);
  EXPECT_NEAR(block.sensed_g[49].y(), 0.8, 1e-12);
  Placement at_once;
  at_once.contiguous = true;
  effect->on_placement(at_once);
  block.sensed_g.assign(block.size(), Eigen::Vector3d(0, 0, 1));
  effect->on_analog(block);
  EXPECT_LT(block.sensed_g[0].z(), 0.1);
  EXPECT_GT(block.sensed_g[0].y(), 0.7);
}

TEST(Bandwidth, ACornerAtHalfTheSampleRateDoesNothing) {
  const auto effect = low_pass(50, 4);
  SimulatedBlock block = made_block(2);
  block.sensed_g = {{1, 2, 3}, {-1, -2, -3}};
  effect->on_analog(block);
  EXPECT_EQ(block.sensed_g[1], Eigen::Vector3d(-1, -2, -3));
}

TEST(Bandwidth, CutsHalfThePowerAtTheCorner) {
  ProtocolRun run = quiet({tone(10, 0.1)});
  // Butterworth: half the power at the corner, whatever the order.
  for (const double order : {1.0, 2.0, 3.0, 4.0, 6.0}) {
    run.effects = {spec("bandwidth", {{"corner_hz", {10}}, {"order", {order}}})};
    EXPECT_NEAR(amplitude_mg(*run_protocol(run), 10), 100 / std::sqrt(2.0), 0.5) << order;
  }
}

}  // namespace
}  // namespace sixpoint::sim
