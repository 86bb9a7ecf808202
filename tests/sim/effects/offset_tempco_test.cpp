#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

// Oracle: closed forms.
TEST(OffsetTempco, TheZeroMovesWithTemperature) {
  EXPECT_NEAR(run("offset_tempco", {{"mg_per_c", {0, 0, 0.6}}}, {0, 0, 1}, 35).sensed_g[0].z(),
              1.006, 1e-12);
}

// Oracle: a straight line through the datasheet's reference of 25 C, whatever acts.
TEST(OffsetTempco, IsRelativeTo25C) {
  const auto effect = made_effect("offset_tempco", {{"mg_per_c", {0.5, -1, 0}}});
  for (const double temperature_c : {-10.0, 15.0, 25.0, 45.0}) {
    for (const double force_g : {-1.0, 0.0, 3.0}) {
      const Eigen::Vector3d sensed = sensed_under(*effect, {force_g, 0, 1}, temperature_c);
      EXPECT_NEAR(sensed.x(), force_g + 0.0005 * (temperature_c - 25), 1e-12);
      EXPECT_NEAR(sensed.y(), -0.001 * (temperature_c - 25), 1e-12);
      EXPECT_NEAR(sensed.z(), 1, 1e-12);
    }
  }
}

}  // namespace
}  // namespace sixpoint::sim
