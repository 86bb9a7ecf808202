#include "station/limits/limits.h"

#include <gtest/gtest.h>

namespace sixpoint::station {
namespace {

TEST(Limits, TheBuiltInOnesAreCompleteAndInThemselvesConsistent) {
  const Limits limits = default_limits();
  ASSERT_EQ(limits.limits.size(), quantities().size());
  for (const QuantityInfo& info : quantities()) {
    const Limit& limit = limits.of(info.name);
    EXPECT_TRUE(limit.low || limit.high) << info.name;
    EXPECT_FALSE(info.reason.empty()) << info.name;
    EXPECT_FALSE(info.high && info.code_high.empty()) << info.name;
    EXPECT_FALSE(info.low && info.code_low.empty()) << info.name;
  }
  EXPECT_EQ(limits.sha256.size(), 64U);
}

// Oracle: the card of the station: noise, tilt and zero offset have limits in their own units.
TEST(Limits, QuantitiesAreFoundByName) {
  ASSERT_NE(find_quantity("zero_offset_mg"), nullptr);
  EXPECT_EQ(find_quantity("zero_offset_mg")->unit, "mg");
  EXPECT_EQ(find_quantity("zero_offset"), nullptr);
  EXPECT_EQ(title_of("zero_offset_mg x"), "Zero offset x, mg");
  EXPECT_EQ(title_of("temperature_c"), "Temperature of the unit, \u00b0C");
  EXPECT_EQ(title_of("beauty x"), "beauty x");
}

}  // namespace
}  // namespace sixpoint::station
