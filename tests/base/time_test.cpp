#include "base/time.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint {
namespace {

TEST(Time, SpellsAndReads) {
  EXPECT_EQ(to_iso8601(from_unix_seconds(1'395'619'200)), "2014-03-24T00:00:00Z");
  EXPECT_EQ(to_iso8601(from_unix_seconds(0) + std::chrono::milliseconds(125)),
            "1970-01-01T00:00:00.125Z");
  EXPECT_EQ(to_iso8601(from_unix_seconds(-1)), "1969-12-31T23:59:59Z");
  EXPECT_EQ(to_unix_seconds(*parse_iso8601("2014-03-24")), 1'395'619'200);
  EXPECT_EQ(to_unix_seconds(*parse_iso8601("2013-11-12T14:32:13Z")), 1'384'266'733);
  for (const std::int64_t ns : {0LL, 125'000'000LL, 783'353'223LL, 999'999'999LL}) {
    const UtcTime time = from_unix_seconds(1'395'619'200) + std::chrono::nanoseconds(ns);
    EXPECT_EQ(parse_iso8601(to_iso8601(time)).value(), time);
  }
  for (const char* wrong :
       {"", "2014", "2014-03-24T00:00:00.", "2014-03-24.5", "2014-03-24T00:00:00.1x",
        "2014-03-24T00:00:00.1234567890", "2014-02-30", "2014-3-24", "2014-03-24T25:00:00",
        "20a4-03-24", "9999-01-01", "2014-03-24 00:00:00"}) {
    EXPECT_FAILS(parse_iso8601(wrong), ErrorCode::bad_data);
  }
}

TEST(Time, SecondsBecomeWholeNanoseconds) {
  EXPECT_EQ(from_seconds(1.5), std::chrono::milliseconds(1500));
  EXPECT_EQ(from_seconds(-0.25), -std::chrono::milliseconds(250));
  EXPECT_EQ(from_seconds(0.9e-9).count(), 0) << "towards zero";
  EXPECT_EQ(to_unix_seconds(from_unix_seconds(-1) + std::chrono::nanoseconds(1)), -1);
}

}  // namespace
}  // namespace sixpoint
