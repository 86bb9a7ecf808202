#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(Hysteresis, HysteresisRemembersTheApproach) {
  ProtocolRun run =
      quiet({at_rest(up(2), 0, 30), at_rest(up(0), 1000, 45), at_rest(up(2), 2000, 60),
             at_rest(up(2, true), 3000, 75), at_rest(up(0), 4000, 90)});
  run.effects = {spec("hysteresis", {{"mg", {10, 10, 10}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  EXPECT_NEAR(mean_mg(*counts, 0, 1000, 2), 1000, 0.4);     // never moved
  EXPECT_NEAR(mean_mg(*counts, 1000, 1000, 0), 1010, 0.4);  // rose
  EXPECT_NEAR(mean_mg(*counts, 1000, 1000, 2), -10, 0.4);   // fell
  EXPECT_NEAR(mean_mg(*counts, 2000, 1000, 2), 1010, 0.4);  // rose
  EXPECT_NEAR(mean_mg(*counts, 4000, 1000, 2), 10, 0.4);    // rose from -1 to 0
}

// Oracle: the definition. Half the difference between two approaches to the same pose is the
// parameter.
TEST(Hysteresis, HalfTheDifferenceBetweenApproachesIsItsSize) {
  const auto effect = made_effect("hysteresis", {{"mg", {0.8, 1.2, 2}}});
  Placement flat;
  flat.rotation = up(2);
  flat.previous = up(2, true);
  effect->on_placement(flat);
  const double from_below_g = sensed_under(*effect, {0, 0, 1}).z();
  Placement again;
  again.rotation = up(0);
  again.previous = up(2);
  effect->on_placement(again);
  EXPECT_NEAR(sensed_under(*effect, {1, 0, 0}).x(), 1.0008, 1e-12);
  const double from_above_g = sensed_under(*effect, {0, 0, 1}).z();
  EXPECT_NEAR((from_below_g - from_above_g) / 2, 0.002, 1e-12);
}

// An axis whose specific force hardly moved keeps what it had.
TEST(Hysteresis, AnAxisThatStaysKeepsItsReading) {
  const auto effect = made_effect("hysteresis", {{"mg", {1, 1, 1}}});
  Placement turned;
  turned.rotation = up(0);
  turned.previous = up(2);
  effect->on_placement(turned);
  EXPECT_EQ(sensed_under(*effect, {1, 0, 0}).y(), 0) << "y lay level before and after";
  Placement yawed = turned;
  yawed.previous = turned.rotation;
  yawed.rotation = turned.rotation * Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ());
  effect->on_placement(yawed);
  EXPECT_NEAR(sensed_under(*effect, {1, 0, 0}).x(), 1.001, 1e-12);
  EXPECT_NEAR(sensed_under(*effect, {1, 0, 0}).z(), -0.001, 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
