#include "gt3x/forms/eeprom.h"

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/recording.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

Bytes real_image() {
  auto recording = Recording::open(posix_env().files,
                                   sixpoint::tests::shared_file("data/nhanes/NEO1B34100019.gt3x"));
  EXPECT_OK(recording);
  const auto source = recording->open_entry("eeprom.bin");
  EXPECT_OK(source);
  return read_all(**source, 1U << 20U).value_or(Bytes{});
}

// Oracle: a real unit's memory, read by hand against the vendor's description. Its CRC is the
// vendor's own.
TEST(Eeprom, ARealImage) {
  SIXPOINT_NEED_SHARED("data/nhanes/NEO1B34100019.gt3x");
  const auto memory = parse_eeprom(real_image());
  ASSERT_OK(memory);
  EXPECT_EQ(memory->serial, "NEO1B34100019");
  EXPECT_EQ(memory->constants.zero_lsb, (PerAxis<int>{-25, -12, -25}));
  EXPECT_EQ(memory->constants.positive_lsb, (PerAxis<int>{242, 260, 238}));
  EXPECT_EQ(memory->constants.negative_lsb, (PerAxis<int>{-304, -280, -300}));
  EXPECT_EQ(memory->calibration_time, parse_iso8601("2010-10-21T11:23:47").value());
  EXPECT_EQ(memory->firmware, "1.4.0");
}

TEST(Eeprom, WhatIsDamagedIsRefused) {
  SIXPOINT_NEED_SHARED("data/nhanes/NEO1B34100019.gt3x");
  const Bytes image = real_image();
  ASSERT_EQ(image.size(), 2048U);
  for (std::size_t at = 256; at < 512; ++at) {
    Bytes damaged = image;
    damaged[at] ^= 0x10;
    EXPECT_FAILS(parse_eeprom(damaged), ErrorCode::bad_data);
  }
  for (std::size_t size = 0; size < 512; ++size) {
    EXPECT_FAILS(parse_eeprom(std::span(image).first(size)), ErrorCode::bad_data);
  }
  EXPECT_OK(parse_eeprom(std::span(image).first(512)));
}

TEST(Eeprom, BatteryEntriesWithoutADateAreLeftOut) {
  const Bytes bytes = {10,   26,   10,   13,   31,   0,    0x84, 0x10,  // 4228 mV
                       0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF,  // erased
                       2,    31,   10,   13,   31,   0,    0x84, 0x10,  // 31 February
                       10,   26};
  const auto readings = parse_old_battery(bytes);
  ASSERT_EQ(readings.size(), 1U);
  EXPECT_EQ(to_iso8601(readings[0].time), "2010-10-26T13:31:00Z");
  EXPECT_DOUBLE_EQ(readings[0].battery_v, 4.228);
}

}  // namespace
}  // namespace sixpoint::gt3x
