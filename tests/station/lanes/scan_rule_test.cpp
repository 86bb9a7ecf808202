// One case for each row of the table in the header.
#include "station/lanes/scan_rule.h"

#include <gmock/gmock.h>

namespace sixpoint::station {
namespace {

TEST(ScanRule, FollowsTheTable) {
  EXPECT_EQ(serial_of_label("sixpoint:MOS2A45130007:0123456789abcdef"), "MOS2A45130007");
  EXPECT_EQ(serial_of_label("SIXPOINT:mos2a45130007:0F"), "MOS2A45130007")
      << "a scanner in capitals";
  EXPECT_EQ(serial_of_label("MOS2A45130007"), "MOS2A45130007");
  EXPECT_EQ(serial_of_label("  mos2a45130007\t"), "MOS2A45130007");
  EXPECT_EQ(serial_of_label("T-1"), "T-1");
  for (const char* none : {"", "  ", "sixpoint:", "sixpoint:MOS2A45130007",
                           "sixpoint:MOS2A45130007:", "sixpoint:MOS2A45130007:xyz", "sixpoint::0f",
                           "https://example.com/MOS2A45130007", "MOS2A4513000712345",
                           "MOS2A 45130007", "sixpoint:MOS2A4513000712345:0f"}) {
    EXPECT_EQ(serial_of_label(none), std::nullopt) << none;
  }
}

}  // namespace
}  // namespace sixpoint::station
