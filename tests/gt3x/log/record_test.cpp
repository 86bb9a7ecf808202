#include "gt3x/log/record.h"

#include <gtest/gtest.h>

namespace sixpoint::gt3x {
namespace {

// Oracle: the METADATA example of the vendor's public description, header 1E 06 71 E8 B4 54 7C 00
// and checksum F8.
TEST(Record, ChecksumOfThePublishedExample) {
  const std::string json =
      R"({"MetadataType":"Bio","SubjectName":"CLE2A1415161)"
      R"(7","Race":"","Limb":"","Side":"","Dominance":"","Parsed":false,"JSON":null})";
  Bytes out;
  append_record(out, RecordType::metadata, 1'421'142'129,
                std::span(reinterpret_cast<const std::uint8_t*>(json.data()), json.size()));
  const Bytes header(out.begin(), out.begin() + 8);
  EXPECT_EQ(header, (Bytes{0x1E, 0x06, 0x71, 0xE8, 0xB4, 0x54, 0x7C, 0x00}));
  EXPECT_EQ(out.size(), 8 + 124 + 1U);
  EXPECT_EQ(out.back(), 0xF8);
}

TEST(Record, ChecksumIsTheComplementOfTheXorForEveryLength) {
  Bytes bytes;
  std::uint8_t plain = 0;
  for (unsigned i = 0; i < 70; ++i) {
    EXPECT_EQ(record_checksum(bytes), static_cast<std::uint8_t>(~plain)) << i;
    bytes.push_back(static_cast<std::uint8_t>(i * 37 + 11));
    plain = static_cast<std::uint8_t>(plain ^ bytes.back());
  }
}

TEST(Record, Names) {
  EXPECT_EQ(record_type_name(0), "ACTIVITY");
  EXPECT_EQ(record_type_name(26), "ACTIVITY2");
  EXPECT_EQ(record_type_name(static_cast<std::uint8_t>(RecordType::sensor_data)), "SENSOR_DATA");
  EXPECT_EQ(record_type_name(static_cast<std::uint8_t>(RecordType::temperature)), "TEMPERATURE");
  EXPECT_EQ(record_type_name(19), "FIFO_ERROR");
  EXPECT_EQ(record_type_name(29), "TYPE_29");
  EXPECT_EQ(record_type_name(200), "TYPE_200");
}

}  // namespace
}  // namespace sixpoint::gt3x
