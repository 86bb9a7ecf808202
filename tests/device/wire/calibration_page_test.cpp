#include "device/wire/calibration_page.h"

#include <gtest/gtest.h>

#include "base/calibration_section.h"
#include "base/env.h"
#include "expect_result.h"
#include "gt3x/recording.h"
#include "shared_data.h"

namespace sixpoint::device {
namespace {

CalibrationPage page_of_450() {
  return {{{326, 287, 303}, {-201, -268, -192}, {61, 4, 61}}, from_unix_seconds(1'384'266'733)};
}

// Oracle: docs/protocol.md, byte by byte.
TEST(CalibrationPage, LaysOutAsWritten) {
  const auto bytes = encode_calibration_page(page_of_450());
  ASSERT_OK(bytes);
  ASSERT_EQ(bytes->size(), kPageBytes);
  EXPECT_EQ(std::string(bytes->begin() + 256, bytes->begin() + 260), "TUNE");
  EXPECT_EQ((*bytes)[260], 61);
  EXPECT_EQ((*bytes)[266], 326 & 0xFF);
  EXPECT_EQ((*bytes)[267], 326 >> 8);
  EXPECT_EQ((*bytes)[272], static_cast<std::uint8_t>(-201 & 0xFF));
  EXPECT_EQ((*bytes)[273], 0xFF);
  const std::uint8_t date[] = {11, 12, 13, 14, 32, 13};  // 2013-11-12 14:32:13
  EXPECT_TRUE(std::equal(std::begin(date), std::end(date), bytes->begin() + 278));
  EXPECT_EQ((*bytes)[0], 0xFF);
  EXPECT_EQ((*bytes)[284], 0xFF);
  EXPECT_EQ(*decode_calibration_page(*bytes), page_of_450());
}

// Oracle: a real unit's memory image: its CRC, made by the vendor's firmware, must hold.
TEST(CalibrationPage, ReadsARealUnitsImage) {
  SIXPOINT_NEED_SHARED("data/nhanes/NEO1B34100019.gt3x");
  auto recording = gt3x::Recording::open(posix_env().files,
                                         tests::shared_file("data/nhanes/NEO1B34100019.gt3x"));
  ASSERT_OK(recording);
  auto entry = recording->open_entry("eeprom.bin");
  ASSERT_OK(entry);
  const auto image = gt3x::read_all(**entry, 1U << 20U);
  ASSERT_OK(image);
  ASSERT_GE(image->size(), kPageBytes);
  const auto page = decode_calibration_page(std::span(*image).first(kPageBytes));
  ASSERT_OK(page);
  EXPECT_EQ(page->constants.zero_lsb, (PerAxis<int>{-25, -12, -25}));
  EXPECT_EQ(page->constants.positive_lsb, (PerAxis<int>{242, 260, 238}));
  EXPECT_EQ(page->constants.negative_lsb, (PerAxis<int>{-304, -280, -300}));
  EXPECT_EQ(to_iso8601(page->calibrated), "2010-10-21T11:23:47Z");
  // And what is written over it is the image, byte for byte: whatever else the vendor keeps in the
  // page stays.
  const auto page_bytes = std::span(*image).first(kPageBytes);
  const auto written = encode_calibration_page(*page, page_bytes);
  ASSERT_OK(written);
  EXPECT_TRUE(std::equal(written->begin(), written->end(), page_bytes.begin(), page_bytes.end()));
  EXPECT_NE(*encode_calibration_page(*page), *written) << "a blank page lacks them";
}

TEST(CalibrationPage, EveryFlippedByteOfTheSectionIsRefused) {
  const Bytes whole = *encode_calibration_page(page_of_450());
  for (std::size_t at = 256; at < whole.size(); ++at) {
    for (const unsigned flip : {0x01U, 0x80U, 0xFFU}) {
      Bytes bytes = whole;
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ flip);
      ASSERT_FALSE(decode_calibration_page(bytes)) << at;
    }
  }
  for (const std::size_t length : {0U, 1U, 256U, 511U}) {
    EXPECT_FAILS(decode_calibration_page(std::span(whole).first(length)), ErrorCode::bad_data);
  }
  EXPECT_FAILS(decode_calibration_page(Bytes(kPageBytes, 0xFF)), ErrorCode::bad_data);
}

TEST(CalibrationPage, RefusesToWriteWhatCannotBe) {
  CalibrationPage page = page_of_450();
  page.constants.positive_lsb[1] = page.constants.negative_lsb[1];
  EXPECT_FAILS(encode_calibration_page(page), ErrorCode::configuration);
  page = page_of_450();
  page.constants.zero_lsb[2] = 5000;
  EXPECT_FAILS(encode_calibration_page(page), ErrorCode::configuration);
  page = page_of_450();
  page.calibrated = from_unix_seconds(0);
  EXPECT_FAILS(encode_calibration_page(page), ErrorCode::configuration);
}

// A section with a right CRC, whose content no calibration gives: a unit must not look calibrated.
TEST(CalibrationPage, AWholeSectionWithoutAValidCalibrationIsRefused) {
  Bytes bytes(kPageBytes, 0xFF);
  write_calibration_section({page_of_450().constants, {}}, bytes);
  const auto undated = decode_calibration_page(bytes);
  EXPECT_FAILS(undated, ErrorCode::bad_data);
  EXPECT_EQ(undated.error().what, "the page's date does not exist");
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    StoredConstants constants = page_of_450().constants;
    constants.positive_lsb[axis] = constants.negative_lsb[axis];
    write_calibration_section({constants, page_of_450().calibrated}, bytes);
    const auto flat = decode_calibration_page(bytes);
    EXPECT_FAILS(flat, ErrorCode::bad_data);
    EXPECT_NE(flat.error().hint.find("calibrate it on the jig"), std::string::npos);
  }
}

// The page holds the years 2000 to 2255.
TEST(CalibrationPage, ADateOutsideOfThePageIsNotWritten) {
  using namespace std::chrono_literals;
  const auto at = [](std::chrono::sys_days day) {
    CalibrationPage page = page_of_450();
    page.calibrated = UtcTime(day);
    return page;
  };
  EXPECT_FAILS(encode_calibration_page(at(1999y / 12 / 31)), ErrorCode::configuration);
  EXPECT_FAILS(encode_calibration_page(at(2256y / 1 / 1)), ErrorCode::configuration);
  for (const auto& page : {at(2000y / 1 / 1), at(2255y / 12 / 31)}) {
    EXPECT_EQ(*decode_calibration_page(*encode_calibration_page(page)), page);
  }
}

}  // namespace
}  // namespace sixpoint::device
