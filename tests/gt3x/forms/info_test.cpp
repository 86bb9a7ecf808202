#include "gt3x/forms/info.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::gt3x {
namespace {

TEST(Info, ReadsWhatRealFilesHold) {
  // Lines as they stand in real files: byte-order mark, decimal comma, ticks.
  const std::string text =
      "\xEF\xBB\xBFSerial Number: MOS2E39180594\r\nDevice Type: wGT3XBT\r\nFirmware: 1.9.2\r\n"
      "Battery Voltage: 4,03\r\nSample Rate: 30\r\nStart Date: 637340333400000000\r\n"
      "Stop Date: 0\r\nTimeZone: 02:00:00\r\nAcceleration Scale: 256.0\r\n"
      "Acceleration Min: -8.0\r\nSubject Name: a: b\r\nno pair\r\n";
  const auto info = Info::parse(text);
  ASSERT_OK(info);
  EXPECT_EQ(info->serial(), "MOS2E39180594");
  EXPECT_EQ(info->firmware(), "1.9.2");
  EXPECT_EQ(info->battery_v(), 4.03);
  EXPECT_EQ(info->sample_rate_hz(), 30.0);
  EXPECT_EQ(info->accel_scale_lsb_per_g(), 256.0);
  EXPECT_EQ(info->accel_min_g(), -8.0);
  EXPECT_EQ(to_iso8601(info->start().value()), "2020-08-26T10:09:00Z");
  EXPECT_FALSE(info->stop());
  EXPECT_FALSE(info->last_sample());
  EXPECT_EQ(info->get("TimeZone"), "02:00:00");
  EXPECT_EQ(info->subject(), "a: b");
  EXPECT_EQ(info->serialise(), text);
}

TEST(Info, SetChangesOneLineAndKeepsTheRest) {
  auto info = Info::parse("A: 1\nB: 2\r\nC: 3");
  ASSERT_OK(info);
  info->set("B", "two\r\nlines");
  info->set("D", "4");
  EXPECT_EQ(info->serialise(), "A: 1\nB: two  lines\r\nC: 3\r\nD: 4\r\n");
  Info made;
  made.set("Serial Number", "MOS2A45130007");
  EXPECT_EQ(made.serialise(), "Serial Number: MOS2A45130007\r\n");
}

TEST(Info, Refuses) {
  EXPECT_FAILS(Info::parse(""), ErrorCode::bad_data);
  EXPECT_FAILS(Info::parse("PK\x03\x04 nothing here"), ErrorCode::bad_data);
  EXPECT_FAILS(Info::parse(std::string(2 << 20, 'a')), ErrorCode::bad_data);
  using namespace std::string_view_literals;
  for (const auto text : {"\xFF\xFE"
                          "A\0:\0 \0"
                          "1\0"sv,
                          "\xFE\xFF\0A\0:\0 \0"
                          "1"sv}) {
    const auto utf16 = Info::parse(text);
    EXPECT_FAILS(utf16, ErrorCode::bad_data);
    EXPECT_NE(utf16.error().what.find("UTF-16"), std::string::npos) << utf16.error().what;
  }
  const auto odd = Info::parse(
      "Sample Rate: fast\nStart Date: 99999999999999999999\nStop Date: -1\n"
      "Acceleration Scale: nan\n: no key\n");
  ASSERT_OK(odd);
  EXPECT_FALSE(odd->sample_rate_hz());
  EXPECT_FALSE(odd->start());
  EXPECT_FALSE(odd->stop());
  EXPECT_FALSE(odd->accel_scale_lsb_per_g());
  EXPECT_FALSE(odd->get(""));
  EXPECT_EQ(Info::parse("Sample Rate: 0")->sample_rate_hz(), 0.0);
}

TEST(Info, OfAKeyThatStandsTwiceTheFirstCountsAndTheOtherIsKnown) {
  const auto two = Info::parse("Firmware: 1.5.0\nRate: 1\nFirmware: 1.5.0 \nFirmware: 1.9.2\n");
  ASSERT_OK(two);
  EXPECT_EQ(two->firmware(), "1.5.0");
  EXPECT_EQ(two->other("Firmware"), "1.9.2");
  EXPECT_FALSE(two->other("Rate"));
  EXPECT_FALSE(two->other("Serial Number"));
}

TEST(Info, TicksBothWays) {
  const auto time = from_ticks(635'641'850'400'000'000);
  ASSERT_TRUE(time);
  EXPECT_EQ(to_iso8601(*time), "2015-04-09T14:04:00Z");
  EXPECT_EQ(to_ticks(*time), 635'641'850'400'000'000);
}

}  // namespace
}  // namespace sixpoint::gt3x
