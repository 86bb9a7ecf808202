#include "sim/firmware.h"

#include <gtest/gtest.h>

namespace sixpoint::sim {
namespace {

UtcTime day(const char* text) { return *parse_iso8601(text); }

// Oracle: the paper's "16CPAN03 Issue Description", row by row.
TEST(Firmware, ChoosesTheFilterLikeThePapersTable) {
  using enum FilterConfiguration;
  const struct {
    const char* serial;
    const char* firmware;
    const char* calibrated;
    FilterConfiguration expected;
  } rows[] = {
      {"MOS2A45130450", "1.1.0", "2013-11-12", legacy},
      {"MOS2A45130450", "1.3.9", "2013-11-12", legacy},
      {"MOS2A45130450", "1.4.0", "2013-11-12", current},
      {"MOS2A45130450", "1.4.1", "2013-11-12", current},
      {"MOS2A45130450", "1.5.0", "2013-11-12", current},
      {"MOS2A45130450", "1.6.0", "2013-11-12", current},
      {"MOS2A45130450", "1.7.0", "2013-11-12", current},
      {"MOS2A45130450", "1.8.0", "2013-11-12", legacy},
      {"MOS2A45130450", "1.10.0", "2013-11-12", legacy},
      {"MOS2A45130450", "1.8.0", "2014-03-23T23:59:59Z", legacy},
      {"MOS2A45130450", "1.8.0", "2014-03-24", current},
      {"MOS2A45130450", "1.2.0", "2014-03-24", current},
      {"TAS1E31150129", "1.2.0", "2013-11-12", current},
  };
  for (const auto& row : rows) {
    EXPECT_EQ(filter_of_recording(row.serial, row.firmware, day(row.calibrated)), row.expected)
        << row.firmware << " " << row.calibrated;
  }
  EXPECT_FALSE(parse_version("1.5"));
  EXPECT_FALSE(parse_version("1.5.0x"));
  EXPECT_FALSE(parse_version(""));
  EXPECT_FALSE(parse_version("1.-5.0"));
}

UnitTruth unit_with(const char* firmware) {
  UnitTruth unit;
  unit.serial = "MOS2A45130007";
  unit.firmware = firmware;
  unit.constants = {{310, 310, 310}, {-202, -202, -202}, {54, 54, 54}};  // 256 LSB/g: exact halves
  unit.accel_scale_lsb_per_g = 256;
  return unit;
}

// Oracle: Eq. 1-6 by hand: (310 - -202) / 2 = 256 LSB/g, so stored = raw - 54.
TEST(Firmware, ScalesByEquations1To6) {
  FirmwareScaler scaler(unit_with("1.5.0"), 12);
  EXPECT_EQ(scaler.store({310, -202, 54}), (gt3x::Counts{256, -256, 0}));
  EXPECT_EQ(scaler.clipped(), 0U);
  EXPECT_EQ(scaler.store({2047, -2048, 54}), (gt3x::Counts{1993, -2048, 0}));
  EXPECT_EQ(scaler.clipped(), 1U);

  UnitTruth coarse = unit_with("1.5.0");
  coarse.accel_scale_lsb_per_g = 128;  // halves: 1 -> 0.5
  FirmwareScaler half(coarse, 12);
  EXPECT_EQ(half.store({55, 53, 57}), (gt3x::Counts{1, -1, 2})) << "half away from zero";
  NumberFormat cut;
  cut.rounding = NumberFormat::Rounding::toward_zero;
  FirmwareScaler truncating(coarse, 12, cut);
  EXPECT_EQ(truncating.store({55, 53, 57}), (gt3x::Counts{0, 0, 1}));
}

TEST(Firmware, Version160TurnsTheAxesOfMosUnits) {
  FirmwareScaler scaler(unit_with("1.6.0"), 12);
  EXPECT_EQ(scaler.store({54 + 10, 54 + 20, 54 + 30}), (gt3x::Counts{-20, 10, 30}));
  EXPECT_EQ(scaler.store({54, -2048, 54}), (gt3x::Counts{2047, 0, 0})) << "clips after the turn";
  UnitTruth other = unit_with("1.6.0");
  other.serial = "TAS1E31150129";
  FirmwareScaler straight(other, 12);
  EXPECT_EQ(straight.store({54 + 10, 54 + 20, 54 + 30}), (gt3x::Counts{10, 20, 30}));
}

TEST(Firmware, ConstantsWithoutRangeGiveZeroAndDoNotDivide) {
  UnitTruth unit = unit_with("1.5.0");
  unit.constants.positive_lsb[0] = unit.constants.negative_lsb[0];
  FirmwareScaler scaler(unit, 12);
  EXPECT_EQ(scaler.store({310, 310, 310})[0], 0);
}

}  // namespace
}  // namespace sixpoint::sim
