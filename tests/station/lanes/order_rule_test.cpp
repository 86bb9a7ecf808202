#include "station/lanes/order_rule.h"

#include <gmock/gmock.h>

namespace sixpoint::station {
namespace {

// The table of the header, row by row.
TEST(OrderRule, FollowsTheTable) {
  EXPECT_FALSE(why_order_is_dead({"MOS2A1", 0, "MOS2A1"}));
  EXPECT_FALSE(why_order_is_dead({"MOS2A1", kOrderLife_s, "MOS2A1"}));
  EXPECT_THAT(*why_order_is_dead({"MOS2A1", 6, "MOS2A1"}), testing::HasSubstr("6 s ago"));
  const std::string other = *why_order_is_dead({"MOS2A1", 0, "MOS2A2"});
  EXPECT_THAT(other, testing::HasSubstr("for unit MOS2A1"));
  EXPECT_THAT(other, testing::HasSubstr("this is MOS2A2"));
  EXPECT_THAT(*why_order_is_dead({"MOS2A1", 0, std::nullopt}), testing::HasSubstr("left"));
}

TEST(OrderRule, TheWordAboutTheJigFollowsItsTable) {
  const std::string stop = "emergency stop";
  EXPECT_FALSE(why_release_is_dead({stop, 0, stop}));
  EXPECT_FALSE(why_release_is_dead({stop, kOrderLife_s, stop}));
  EXPECT_THAT(*why_release_is_dead({stop, 6, stop}), testing::HasSubstr("6 s ago"));
  EXPECT_THAT(*why_release_is_dead({stop, 0, "motor is hot"}), testing::HasSubstr("motor is hot"));
  EXPECT_THAT(*why_release_is_dead({stop, 0, ""}), testing::HasSubstr("free already"));
}

}  // namespace
}  // namespace sixpoint::station
