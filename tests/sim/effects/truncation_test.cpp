#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(Truncation, TruncationMovesTowardZero) {
  const SimulatedBlock cut = run("truncation", {}, {0.3, -0.5, 0.8});
  const SimulatedBlock whole = run("tilt", {{"rotation_vector_deg", {0, 0, 0}}}, {0.3, -0.5, 0.8});
  int moved = 0;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_LE(std::abs(cut.stored[0][axis]), std::abs(whole.stored[0][axis]));
    moved += cut.stored[0][axis] != whole.stored[0][axis] ? 1 : 0;
  }
  EXPECT_GT(moved, 0);
}

TEST(Truncation, StoresTheCountNearerToZero) {
  ProtocolRun run = quiet({at_rest(up(2), 0, 50)});
  run.accel_scale_lsb_per_g = 256;
  run.offset_g = {-0.7 / 256, 0.7 / 256, 0};
  run.effects = {spec("truncation")};
  EXPECT_EQ((*run_protocol(run))[0], (gt3x::Counts{0, 0, 256}));
}

// Oracle: the fraction is dropped, by hand.
TEST(Truncation, DropsTheFraction) {
  EXPECT_EQ(integer_under("truncation", 0.9), 0);
  EXPECT_EQ(integer_under("truncation", -0.9), 0);
  EXPECT_EQ(integer_under("truncation", 255.999), 255);
  EXPECT_EQ(integer_under("truncation", -255.999), -255);
  EXPECT_EQ(integer_under("truncation", -7), -7);
}

// Oracle: closed form. With Gaussian noise the fraction that is dropped is even between 0 and 1, so
// the mean is off by -erf(mean / (sigma sqrt 2)) / 2.
TEST(Truncation, TheBiasUnderNoiseFollowsTheErrorFunction) {
  constexpr double kSigma_lsb = 2;
  constexpr double kStep_lsb = 1.0 / 64;
  for (const double mean_lsb : {-8.0, -2.0, -0.5, 0.0, 1.0, 3.0, 10.0}) {
    double bias_lsb = 0;
    for (int i = -2000; i < 2000; ++i) {
      const double value_lsb = (i + 0.5) * kStep_lsb;
      const double z = (value_lsb - mean_lsb) / kSigma_lsb;
      const double density = std::exp(-z * z / 2) / (kSigma_lsb * std::sqrt(2 * std::numbers::pi));
      bias_lsb += (integer_under("truncation", value_lsb) - value_lsb) * density * kStep_lsb;
    }
    EXPECT_NEAR(bias_lsb, -std::erf(mean_lsb / (kSigma_lsb * std::numbers::sqrt2)) / 2, 1e-3)
        << mean_lsb;
  }
}

}  // namespace
}  // namespace sixpoint::sim
