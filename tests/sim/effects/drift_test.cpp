#include <cmath>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(Drift, CountsFromPowerOn) {
  ProtocolRun run = quiet({at_rest(up(2), 0, 100, 10), at_rest(up(2), 10, 3600, 10)});
  run.effects = {spec("drift", {{"mg_per_h", {0, 20, 0}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  EXPECT_NEAR(mean_mg(*counts, 10, 10, 1), 20, 0.4);
}

// Oracle: a straight line through zero at power-on.
TEST(Drift, TheZeroMovesByTheSameEveryHour) {
  const auto effect = made_effect("drift", {{"mg_per_h", {2, -4, 0}}});
  const Eigen::Vector3d force_g(0.6, 0, 0.8);
  for (const double hours : {0.0, 0.5, 1.0, 3.0}) {
    const Eigen::Vector3d sensed = sensed_under(*effect, force_g, 25, 3600 * hours);
    EXPECT_NEAR(sensed.x(), 0.6 + 0.002 * hours, 1e-12);
    EXPECT_NEAR(sensed.y(), -0.004 * hours, 1e-12);
    EXPECT_NEAR(sensed.z(), 0.8, 1e-12);
  }
}

}  // namespace
}  // namespace sixpoint::sim
