#include "station/capture/calibration_file.h"

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::station {
namespace {

using calib::FilterConfiguration;
using testing::HasSubstr;

// The rows of the table in the header.
TEST(CalibrationFile, WhatCanHelp) {
  constexpr auto kLegacy = FilterConfiguration::legacy;
  constexpr auto kCurrent = FilterConfiguration::current;
  const auto first = [](const RecordingOrigin& origin) {
    const auto refusal = why_recording_cannot_help(origin);
    EXPECT_TRUE(refusal.empty() || refusal.size() == 2) << "why, and what to do";
    return refusal.empty() ? std::string() : refusal.front();
  };
  EXPECT_EQ(first({"NEO1A23456789", "1.7.0", std::nullopt, true}), "");
  EXPECT_THAT(first({"NEO1A23456789", "1.7.0", kCurrent, false}), HasSubstr("never affected"));
  EXPECT_THAT(first({"MOS2A23456789", "1.7.0", std::nullopt, false}), HasSubstr("which filter"));
  EXPECT_THAT(first({"MOS2A23456789", "1.8.0", kLegacy, false}), HasSubstr("'legacy'"));
  EXPECT_THAT(first({"MOS2A23456789", "1.8.0", kLegacy, true}), HasSubstr("'legacy'"));
  EXPECT_EQ(first({"MOS2A23456789", "1.7.0", kCurrent, false}), "");
  EXPECT_EQ(first({"MOS2A23456789", "1.7.0", kCurrent, true}), "");
}

TEST(CalibrationFile, WhatIsNoRecordingIsAnError) {
  MemoryEnv env;
  EXPECT_FALSE(check_calibration_file(env.env, "none.gt3x"));
}

}  // namespace
}  // namespace sixpoint::station
