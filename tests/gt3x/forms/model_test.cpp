#include "gt3x/forms/model.h"

#include <utility>

#include <gtest/gtest.h>

namespace sixpoint::gt3x {
namespace {

// The vendor's public descriptions, as model.h names them.
TEST(Model, FollowsThePrefix) {
  using Row = std::pair<const char*, const char*>;
  for (const auto& [serial, model] :
       {Row{"NEO1F12345678", "GT3X+"}, Row{"MOS2A45130450", "wGT3X-BT"},
        Row{"MOS3A1", "wActiSleep+"}, Row{"MOS4A1", "wActiSleep-BT"},
        Row{"MOS9", "wGT3X-BT family"}, Row{"CLE2A1", "wGT3X+"}, Row{"TAS1", "GT9X Link"},
        Row{"CPW1", "CentrePoint Insight Watch"}, Row{"neo1f12345678", "GT3X+"},
        Row{"Mos2", "wGT3X-BT"}, Row{"", "unknown"}, Row{"NE", "unknown"}}) {
    EXPECT_EQ(model_of(serial), model);
  }
}

TEST(Model, ASerialNumberIsInCapitalsWhereTheModelIsKnown) {
  EXPECT_EQ(unit_serial("mos2a45130450"), "MOS2A45130450");
  EXPECT_EQ(unit_serial("Cpw1b"), "CPW1B");
  EXPECT_EQ(unit_serial("MOS2A45130450"), "MOS2A45130450");
  EXPECT_EQ(unit_serial("ab12"), "ab12") << "another maker's";
  EXPECT_EQ(unit_serial("mos2-a"), "mos2-a") << "no unit's";
  EXPECT_EQ(unit_serial("mos2a451304501234"), "mos2a451304501234") << "longer than a unit's";
  EXPECT_EQ(unit_serial(""), "");
}

TEST(Model, ScaleOnlyWhereItIsKnown) {
  EXPECT_EQ(default_accel_scale_lsb_per_g("NEO1"), 341);
  EXPECT_EQ(default_accel_scale_lsb_per_g("MOS0"), 256);
  EXPECT_EQ(default_accel_scale_lsb_per_g("MOS2A1"), 256);
  EXPECT_EQ(default_accel_scale_lsb_per_g("MRA1"), 341);
  EXPECT_EQ(default_accel_scale_lsb_per_g("neo1"), 341);
  EXPECT_EQ(default_accel_scale_lsb_per_g("CPW1"), std::nullopt);
}

}  // namespace
}  // namespace sixpoint::gt3x
