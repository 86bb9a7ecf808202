#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(Settling, SettlingRingsAfterAMoveOnly) {
  ProtocolRun run =
      quiet({at_rest(up(2), 0, 30), at_rest(up(0), 1000, 45), at_rest(up(0), 2000, 60)});
  run.effects = {
      spec("settling", {{"amplitude", {0.1}}, {"frequency_hz", {5}}, {"decay_s", {0.3}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  for (std::size_t i = 0; i < 100; ++i) {
    const double t = static_cast<double>(i) / 100;
    const double ring = 100 * std::exp(-t / 0.3) * std::cos(2 * std::numbers::pi * 5 * t);
    EXPECT_NEAR(mean_mg(*counts, i, 1, 2), 1000, 0.4);
    EXPECT_NEAR(mean_mg(*counts, 1000 + i, 1, 0), 1000 - ring, 0.4);
    EXPECT_NEAR(mean_mg(*counts, 1000 + i, 1, 2), ring, 0.4);
    EXPECT_NEAR(mean_mg(*counts, 2000 + i, 1, 0), 1000, 0.4);
  }
}

// Specific force in the sensor's frame, in g, after the unit was turned from z up to x up.
std::vector<Eigen::Vector3d> after_a_turn(const ParameterSet& given, bool contiguous) {
  const auto effect = made_effect("settling", given);
  Placement turned;
  turned.start_s = 40;
  turned.previous = up(2);
  turned.rotation = up(0);
  turned.contiguous = contiguous;
  effect->on_placement(turned);
  SimulatedBlock block = made_block(200, 100, 40);
  std::vector<Eigen::Vector3d> felt;
  for (MotionState& motion : block.motion) {
    motion.rotation = up(0);
  }
  effect->on_stimulus(block);
  for (const MotionState& motion : block.motion) {
    felt.emplace_back(motion.rotation * motion.force_lab_g);
  }
  return felt;
}

// Oracle: the shares of the two modes add up to the amplitude: the first sample is off by 10 % of
// the step, whatever the shares. A fifth of a second later, with 5 Hz and 10 Hz, both modes are at
// their crests: 0.1 (0.7 e^-0.5 + 0.3 e^-0.75).
TEST(Settling, TheSecondModeTakesItsShareOfTheAmplitude) {
  for (const double share : {0.0, 0.3}) {
    const auto felt = after_a_turn({{"amplitude", {0.1}},
                                    {"frequency_hz", {5}},
                                    {"decay_s", {0.4}},
                                    {"second_share", {share}},
                                    {"second_ratio", {2}}},
                                   false);
    EXPECT_LT((felt[0] - Eigen::Vector3d(0.9, 0, 0.1)).norm(), 1e-12);
    const double later = 0.1 * ((1 - share) * std::exp(-0.5) + share * std::exp(-0.75));
    EXPECT_LT((felt[20] - Eigen::Vector3d(1 - later, 0, later)).norm(), 1e-9) << share;
  }
}

TEST(Settling, WhatGoesOnWithoutAPauseDoesNotRingAgain) {
  for (const Eigen::Vector3d& felt : after_a_turn({{"amplitude", {0.1}}}, true)) {
    EXPECT_EQ(felt, Eigen::Vector3d(1, 0, 0));
  }
}

}  // namespace
}  // namespace sixpoint::sim
