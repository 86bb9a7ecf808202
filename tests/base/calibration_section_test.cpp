#include "base/calibration_section.h"

#include <array>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint {
namespace {

// The real image is read in tests/gt3x/forms/eeprom_test.cpp, the page byte by byte in
// tests/device/wire/calibration_page_test.cpp.

TEST(CalibrationSection, WhatIsWrittenIsReadAndTheRestStays) {
  std::array<std::uint8_t, kMemoryWithCalibration + 3> memory{};
  memory.fill(0x5A);
  for (const char* const text :
       {"", "2013-11-12T14:32:13", "2199-12-31T23:59:59", "2000-01-01T00:00:00"}) {
    const auto time = parse_iso8601(text);
    const auto calibrated = time ? std::optional(*time) : std::nullopt;
    EXPECT_EQ(calibrated.has_value(), *text != '\0');
    const StoredConstants constants{{2047, 287, 303}, {-201, -2048, -192}, {61, -4, 0}};
    write_calibration_section({constants, calibrated}, memory);
    const auto read = read_calibration_section(memory);
    ASSERT_OK(read);
    EXPECT_EQ(read->constants, constants);
    EXPECT_EQ(read->calibrated, calibrated);
  }
  EXPECT_EQ(memory[255], 0x5A);
  EXPECT_EQ(memory[284], 0x5A);
  EXPECT_EQ(memory[512], 0x5A);
}

TEST(CalibrationSection, DatesThatAreNone) {
  struct Row {
    std::array<std::uint8_t, kMemoryDate> bytes;
    const char* time;  // empty: none
  };
  const Row rows[] = {
      {{11, 12, 13, 14, 32, 13}, "2013-11-12T14:32:13Z"},
      {{2, 29, 12, 0, 0, 0}, "2012-02-29T00:00:00Z"},
      {{2, 29, 13, 0, 0, 0}, ""},
      {{13, 1, 13, 0, 0, 0}, ""},
      {{0, 1, 13, 0, 0, 0}, ""},
      {{1, 0, 13, 0, 0, 0}, ""},
      {{1, 1, 13, 24, 0, 0}, ""},
      {{1, 1, 13, 0, 60, 0}, ""},
      {{1, 1, 13, 0, 0, 60}, ""},
      {{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}, ""},
  };
  for (const Row& row : rows) {
    const auto time = read_memory_date(row.bytes);
    EXPECT_EQ(time ? to_iso8601(*time) : "", row.time);
  }
  EXPECT_EQ(read_memory_date(std::span(rows[0].bytes).first(5)), std::nullopt);
}

}  // namespace
}  // namespace sixpoint
