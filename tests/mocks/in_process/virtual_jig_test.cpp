#include "mocks/in_process/virtual_jig.h"

#include <cmath>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "mocks/made_bench.h"

namespace sixpoint::mocks {
namespace {

using device::Pose;
using sim::FilterConfiguration;

TEST(VirtualUnit, ATiltedPlacementIsTilted) {
  Bench bench;
  ASSERT_OK(bench.unit->set_filter(FilterConfiguration::current));
  bench.jig->tilt_next(7.2);
  ASSERT_OK(bench.jig->go_to(Pose::plus_z));
  bench.clock->sleep(std::chrono::seconds(2));
  ASSERT_OK(bench.unit->start_stream(100));
  const auto mean = mean_of_stream(bench, 100);
  const sim::SensorTruth& truth = bench.plugged->unit.truth().current;
  const auto g = [&](std::size_t axis) {
    return (mean[axis] - truth.zero_lsb[axis]) / truth.sensitivity_lsb_per_g[axis];
  };
  EXPECT_NEAR(std::atan2(std::hypot(g(0), g(1)), g(2)) * 180 / std::acos(-1.0), 7.2, 0.1);
}

// The reading of the unit as it stands, in g, by the sensor that it was made of.
PerAxis<double> reading_g(Bench& bench) {
  EXPECT_OK(bench.unit->start_stream(100));
  const auto mean = mean_of_stream(bench, 50);
  EXPECT_OK(bench.unit->stop_stream());
  const sim::SensorTruth& truth = bench.plugged->unit.truth().current;
  PerAxis<double> g{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    g[axis] = (mean[axis] - truth.zero_lsb[axis]) / truth.sensitivity_lsb_per_g[axis];
  }
  return g;
}

// device/jig.h: after stop() nothing moves until release(). Oracle: gravity is 1 g in any
// pose, and half-way from +z to +x it lies between the two.
TEST(VirtualJig, StoppedInMidTurnItStaysThere) {
  Bench bench;
  ASSERT_OK(bench.unit->set_filter(FilterConfiguration::current));
  ASSERT_OK(bench.jig->go_to(Pose::plus_z));
  bench.clock->sleep(std::chrono::seconds(5));
  ASSERT_OK(bench.jig->go_to(Pose::plus_x));
  bench.clock->sleep(std::chrono::milliseconds(750));
  ASSERT_OK(bench.jig->stop());
  EXPECT_FALSE(bench.jig->position()->pose.has_value());
  const auto first = reading_g(bench);
  EXPECT_NEAR(std::hypot(first[0], first[1], first[2]), 1, 0.01);
  EXPECT_GT(first[0], 0.1);
  EXPECT_GT(first[2], 0.1);
  bench.clock->sleep(std::chrono::minutes(1));
  EXPECT_FALSE(bench.jig->position()->pose.has_value()) << "it does not know where it stands";
  const auto later = reading_g(bench);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_NEAR(later[axis], first[axis], 0.01);  // noise of 300 samples, 0.3 mg
  }
  EXPECT_FAILS(bench.jig->go_to(Pose::plus_x), ErrorCode::device_unavailable);
  EXPECT_EQ(bench.plugged->motor.movements_after_stop, 0);
  ASSERT_OK(bench.jig->release());
  ASSERT_OK(bench.jig->go_to(Pose::plus_x));
  bench.clock->sleep(std::chrono::seconds(5));
  EXPECT_EQ(bench.jig->position()->pose, Pose::plus_x);
  EXPECT_NEAR(reading_g(bench)[0], 1, 0.01);
}

TEST(VirtualJig, AStopAtRestChangesNothing) {
  Bench bench;
  ASSERT_OK(bench.jig->go_to(Pose::minus_y));
  bench.clock->sleep(std::chrono::seconds(5));
  ASSERT_OK(bench.jig->stop());
  EXPECT_EQ(bench.jig->position()->pose, Pose::minus_y);
}

TEST(VirtualJig, OnlyTheNextPoseIsTilted) {
  Bench bench;
  ASSERT_OK(bench.unit->set_filter(FilterConfiguration::current));
  bench.jig->tilt_next(20);
  ASSERT_OK(bench.jig->go_to(Pose::plus_z));
  bench.clock->sleep(std::chrono::seconds(5));
  EXPECT_NEAR(reading_g(bench)[2], std::cos(20 * std::acos(-1.0) / 180), 0.005);
  ASSERT_OK(bench.jig->go_to(Pose::plus_z));
  bench.clock->sleep(std::chrono::seconds(5));
  EXPECT_NEAR(reading_g(bench)[2], 1, 0.005);
}

// Oracle: closed form. A base that is tilted by t about a level axis shows its sine on a level axis
// of the unit, with the other sign after half a turn; what is turned in the case shows alike in
// both.
TEST(VirtualJig, AHalfTurnChangesTheSignOfTheTiltAndNotOfTheMisalignment) {
  constexpr double kRad = 3.14159265358979323846 / 180;
  VirtualUnitOptions options;
  options.seating_deg = 0;
  options.jig_tilt_deg = {2, 0, 0};        // about "to the right": "up" leans away by -2 degrees
  options.misalignment_deg = {0, 1.5, 0};  // about the unit's y
  Bench bench("1.5.0", options);
  ASSERT_OK(bench.unit->set_filter(FilterConfiguration::current));
  ASSERT_TRUE(bench.jig->can_half_turn());
  PerAxis<double> at[2];
  for (const bool turned : {false, true}) {
    ASSERT_OK(turned ? bench.jig->go_to_half_turned(Pose::plus_z) : bench.jig->go_to(Pose::plus_z));
    bench.clock->sleep(std::chrono::seconds(2));
    at[turned ? 1 : 0] = reading_g(bench);
  }
  // The force leans by 2 degrees against y as it lies at first; y points the other way after a half
  // turn. The case's y axis is not moved by a rotation about y; x gets the sine of 1.5 degrees.
  const double tilt_g = std::sin(2 * kRad);
  const double misalignment_g = std::sin(1.5 * kRad) * std::cos(2 * kRad);
  EXPECT_NEAR(at[0][1], -tilt_g, 4e-4);
  EXPECT_NEAR(at[1][1], tilt_g, 4e-4);
  EXPECT_NEAR(at[0][0], misalignment_g, 4e-4);
  EXPECT_NEAR(at[1][0], misalignment_g, 4e-4);
}

// Oracle: the directions themselves; the sensor's truth undoes its own scale and zero.
TEST(VirtualJig, StandsAUnitOnItsCorners) {
  VirtualUnitOptions options;
  options.seating_deg = 0;
  Bench bench("1.5.0", options);
  ASSERT_OK(bench.unit->set_filter(FilterConfiguration::current));
  for (const device::Corner& corner : device::kCorners) {
    SCOPED_TRACE(device::to_string(corner));
    ASSERT_OK(bench.jig->go_to_corner(corner));
    bench.clock->sleep(std::chrono::seconds(2));
    EXPECT_FALSE(bench.jig->position()->pose) << "it stands on none of the six sides";
    const PerAxis<double> at = reading_g(bench);
    for (std::size_t a = 0; a < kAxes; ++a) {
      EXPECT_NEAR(at[a], corner.signs[a] * 0.57735, 1e-3);
    }
  }
  ASSERT_OK(bench.jig->stop());
  EXPECT_FAILS(bench.jig->go_to_corner(device::kCorners[0]), ErrorCode::device_unavailable);
}

}  // namespace
}  // namespace sixpoint::mocks
