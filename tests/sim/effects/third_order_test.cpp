#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(ThirdOrder, ThirdOrderMakesAThirdHarmonic) {
  ProtocolRun run = quiet({tone(5, 1)});
  run.segments[0].rotation = up(0);
  run.accel_scale_lsb_per_g = 900;
  run.effects = {spec("third_order", {{"mg_per_g3", {40, 0, 0}}})};
  run.segments[0].vibration->direction_lab = Eigen::Vector3d(1, 0, 0);
  // Along lab x the sensor's y feels it: no K3 there.
  const auto flat = run_protocol(run);
  ASSERT_OK(flat);
  for (std::size_t i = 0; i < 1000; ++i) {
    const double expected = std::sin(2 * std::numbers::pi * 5 * static_cast<double>(i) / 100 + 0.3);
    ASSERT_NEAR((*flat)[i][1], 900 * expected, 0.51) << i;
    ASSERT_NEAR((*flat)[i][0], 900 * 1.04, 0.51);
  }
  run.effects = {spec("third_order", {{"mg_per_g3", {0, 40, 0}}})};
  const auto curved = run_protocol(run);
  ASSERT_OK(curved);
  for (std::size_t i = 0; i < 1000; ++i) {
    const double a = std::sin(2 * std::numbers::pi * 5 * static_cast<double>(i) / 100 + 0.3);
    ASSERT_NEAR((*curved)[i][1], 900 * (a + 0.04 * a * a * a), 0.51) << i;
  }
}

// Oracle: a + K3 a^3 of each axis, by hand; 0.08 mg/g^3 at 8 g is the 40 mg of the ADXL362
// datasheet's nonlinearity (0.5 % of full scale), within rounding.
TEST(ThirdOrder, GrowsWithTheCubeAndChangesItsSignWithTheForce) {
  const auto effect = made_effect("third_order", {{"mg_per_g3", {0.08, -0.04, 0}}});
  EXPECT_NEAR(sensed_under(*effect, {8, 0, 0}).x(), 8.04096, 1e-12);
  EXPECT_NEAR(sensed_under(*effect, {-8, 0, 0}).x(), -8.04096, 1e-12);
  EXPECT_NEAR(sensed_under(*effect, {0, 5, 1}).y(), 4.995, 1e-12);
  EXPECT_NEAR(sensed_under(*effect, {0, 5, 1}).z(), 1, 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
