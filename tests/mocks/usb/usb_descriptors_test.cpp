#include "mocks/usb/usb_descriptors.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::mocks {
namespace {

// Oracle: RFC 2781's example of U+10000 and above, and Latin letters.
TEST(UsbDescriptors, StringsAreUtf16) {
  UsbDescriptors usb;
  usb.strings = {{1, "\xC3\xA4"}, {2, "\xF0\x90\x80\x80"}, {3, "\xFF"}, {4, std::string(300, 'a')}};
  EXPECT_EQ(string_descriptor(usb, 1), (Bytes{4, 3, 0xE4, 0x00}));
  EXPECT_EQ(string_descriptor(usb, 2), (Bytes{6, 3, 0x00, 0xD8, 0x00, 0xDC}));
  EXPECT_EQ(string_descriptor(usb, 4).size(), 254U);
  EXPECT_EQ(string_descriptor(usb, 9), Bytes{});
}

// The bytes of USB 2.0, tables 9-10, 9-12 and 9-13, written out.
TEST(UsbDescriptors, ConfigurationIsParsed) {
  const Bytes bytes = {9, 2, 25, 0,    1, 1, 0, 0x80, 50, 9,    4,    0, 0,
                       1, 8, 6,  0x50, 0, 7, 5, 0x83, 2,  0x00, 0x02, 0};
  const auto configuration = parse_configuration(bytes);
  ASSERT_OK(configuration);
  EXPECT_EQ(configuration->attributes, 0x80);
  ASSERT_NE(configuration->interface(0), nullptr);
  EXPECT_EQ(configuration->interface(0)->protocol, 0x50);
  EXPECT_EQ(configuration->interface(1), nullptr);
  ASSERT_NE(configuration->endpoint(0x83), nullptr);
  EXPECT_EQ(configuration->endpoint(0x83)->max_packet, 512);
  EXPECT_EQ(configuration->endpoint(0x03), nullptr);
}

TEST(UsbDescriptors, ContradictingLengthsAreRefused) {
  const Bytes good = {9, 2, 25, 0,    1, 1, 0, 0x80, 50, 9,    4,    0, 0,
                      1, 8, 6,  0x50, 0, 7, 5, 0x83, 2,  0x00, 0x02, 0};
  EXPECT_FAILS(parse_configuration(std::span(good).first(8)), ErrorCode::bad_data);
  EXPECT_FAILS(parse_configuration(std::span(good).first(24)), ErrorCode::bad_data);
  const std::vector<std::pair<std::size_t, std::uint8_t>> changes = {{2, 24}, {4, 2},  {9, 0},
                                                                     {9, 1},  {18, 8}, {10, 5}};
  for (const auto& [at, value] : changes) {
    Bytes bad = good;
    bad[at] = value;
    EXPECT_FAILS(parse_configuration(bad), ErrorCode::bad_data);
  }
}

}  // namespace
}  // namespace sixpoint::mocks
