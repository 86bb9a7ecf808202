#include "sim/unit_truth.h"

#include <cmath>

#include <gtest/gtest.h>

#include "sim/firmware.h"

namespace sixpoint::sim {
namespace {

// Oracle: the ranges that domain knowledge gives for real units.
TEST(UnitTruth, DrawnUnitsAreReal) {
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    const UnitTruth unit = draw_unit(seed);
    EXPECT_EQ(filter_of_constants(unit.serial, unit.calibrated), FilterConfiguration::legacy);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double gain =
          unit.current.sensitivity_lsb_per_g[axis] / unit.legacy.sensitivity_lsb_per_g[axis];
      EXPECT_GT(gain, 0.78);
      EXPECT_LT(gain, 0.97);
      const double offset_g = std::abs(unit.current.zero_lsb[axis] - unit.legacy.zero_lsb[axis]) /
                              unit.legacy.sensitivity_lsb_per_g[axis];
      EXPECT_GE(offset_g, 0.1);
      EXPECT_LE(offset_g, 0.2);
      const int positive = unit.constants.positive_lsb[axis];
      const int negative = unit.constants.negative_lsb[axis];
      EXPECT_NEAR((positive - negative) / 2.0, unit.legacy.sensitivity_lsb_per_g[axis], 1);
      const double off = (positive + negative) / 2.0 - unit.constants.zero_lsb[axis];
      EXPECT_GT(std::abs(off), 0.5);
      EXPECT_LT(std::abs(off), 8.5);
    }
  }
  EXPECT_NE(draw_unit(1).current, draw_unit(2).current);
  EXPECT_EQ(draw_unit(3).current, draw_unit(3).current);
}

TEST(UnitTruth, AWishChangesOnlyWhatItNames) {
  const UnitTruth drawn = draw_unit(7);
  GivenProperties given;
  given.serial = "MOS2A45130007";
  given.current_zero_lsb = PerAxis<double>{49.9, 95.8, 60.8};
  const UnitTruth unit = draw_unit(7, given);
  EXPECT_EQ(unit.serial, "MOS2A45130007");
  EXPECT_EQ(unit.current.zero_lsb, *given.current_zero_lsb);
  EXPECT_EQ(unit.current.sensitivity_lsb_per_g, drawn.current.sensitivity_lsb_per_g);
  EXPECT_EQ(unit.legacy, drawn.legacy);
  EXPECT_EQ(unit.constants, drawn.constants);
  EXPECT_EQ(unit.firmware, drawn.firmware);
}

TEST(UnitTruth, TheSensorFollowsWishedConstantsUnderTheirOwnConfiguration) {
  GivenProperties given;
  given.positive_lsb = PerAxis<int>{311, 310, 287};
  given.negative_lsb = PerAxis<int>{-204, -216, -234};
  given.zero_lsb = PerAxis<int>{54, 47, 26};
  given.calibrated = *parse_iso8601("2013-11-12");
  UnitTruth unit = draw_unit(7, given);
  EXPECT_EQ(unit.legacy.sensitivity_lsb_per_g, (PerAxis<double>{257.5, 263, 260.5}));
  EXPECT_EQ(unit.legacy.zero_lsb, (PerAxis<double>{53.5, 47, 26.5}));
  EXPECT_NE(unit.current, unit.legacy);
  EXPECT_EQ(unit.constants.zero_lsb, *given.zero_lsb);
  given.calibrated = *parse_iso8601("2018-01-01");
  unit = draw_unit(7, given);
  EXPECT_EQ(unit.current.sensitivity_lsb_per_g, (PerAxis<double>{257.5, 263, 260.5}));
}

}  // namespace
}  // namespace sixpoint::sim
