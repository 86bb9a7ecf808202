#include "gt3x/forms/small_records.h"

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gt3x/log/record.h"

namespace sixpoint::gt3x {
namespace {

using TextRows = std::vector<std::vector<std::string>>;

std::uint8_t number_of(RecordType type) { return static_cast<std::uint8_t>(type); }

TEST(SmallRecords, NamesAndNumbersOfTypes) {
  for (unsigned type = 0; type <= 0xFF; ++type) {
    const std::string name = record_type_name(static_cast<std::uint8_t>(type));
    if (!name.starts_with("TYPE_")) {
      EXPECT_EQ(parse_record_type(name).value(), type) << name;
    }
    EXPECT_EQ(parse_record_type(std::to_string(type)).value(), type);
  }
  for (const char* name : {"", "battery", "256", "-1", "2x", "BATTERY "}) {
    SCOPED_TRACE(name);
    EXPECT_FAILS(parse_record_type(name), ErrorCode::usage);
  }
}

// The table of old_lux(), a row each. Oracle: the example of the vendor's description (lux.bin.md) for
// GT3X+, with its limits for ActiSleep+.
TEST(SmallRecords, LuxOfTheOldForm) {
  struct Case {
    int reading;
    double gt3x_plus;
    double actisleep_plus;
  };
  for (const Case& one : std::vector<Case>{{0, 0, 0},
                                           {19, 0, 0},
                                           {20, 25, 65},
                                           {0xFFFF, 0, 0},
                                           {0xFFFE, 2500, 6000},
                                           {2200, 2500, 6000},
                                           {1100, 1375, 3575},
                                           {21, 26.25, 68.25}}) {
    EXPECT_EQ(old_lux("NEO1B34100019", one.reading), one.gt3x_plus) << one.reading;
    EXPECT_EQ(old_lux("neo1b34100019", one.reading), one.gt3x_plus) << one.reading;
    EXPECT_EQ(old_lux("MRA1C16110020", one.reading), one.actisleep_plus) << one.reading;
    EXPECT_FALSE(old_lux("CLE1B34100019", one.reading)) << one.reading;
    EXPECT_FALSE(old_lux("", one.reading)) << one.reading;
  }
}

// The rows of the table in the header. The beacons are the example of the vendor's description.
TEST(SmallRecords, SaysWhatEveryTypeSays) {
  const std::string beacon = "TAS0C32140026";
  Bytes tag(beacon.begin(), beacon.end());
  tag.insert(tag.end(), {0x00, 0xD6});
  TemperatureCalibration line;
  line.low = {10, 970, 68};
  line.high = {40, 1075, 536};
  struct Case {
    RecordType type;
    Bytes payload;
    TextRows rows;
  };
  const std::vector<Case> cases = {
      {RecordType::battery, {0x21, 0x10}, {{"4.129"}}},
      {RecordType::event, {0x08}, {{"8", "08"}}},
      {RecordType::event, {0x05, 0x01, 0x03}, {{"5", "050103"}}},
      {RecordType::heart_rate_bpm, {72}, {{"72"}}},
      {RecordType::lux, {0x2C, 0x01}, {{"300"}}},
      {RecordType::lux, {0xFF, 0xFF}, {{""}}},
      {RecordType::metadata, {'a', '"', '\n'}, {{"\"a\"\"\\x0a\""}}},
      {RecordType::tag, tag, {{"\"TAS0C32140026\"", "0", "-42"}}},
      {RecordType::tag, {}, {}},
      {RecordType::heart_rate_ant,
       {1, 0x00, 0x02, 0x00, 0x04, 2, 0x00, 0x04, 0x00, 0x08},
       {{"1", "0.5", "1"}, {"2", "1", "2"}}},
      {RecordType::capsense, {0x3F, 0x18, 0x56, 0x18, 0x01, 0xC8}, {{"6207", "6230", "1", "200"}}},
      {RecordType::temperature, {0, 0xCA, 0x03, 1, 0x44, 0x00}, {{"970", "68", "10", "10"}}},
      {RecordType::temperature, {1, 0x18, 0x02}, {{"", "536", "", "40"}}},
      {RecordType::epoch, {0xAB, 0x01}, {{"ab01"}}},
  };
  for (const Case& one : cases) {
    const auto rows = small_record_rows(number_of(one.type), one.payload, line);
    ASSERT_OK(rows);
    EXPECT_EQ(*rows, one.rows) << record_type_name(number_of(one.type));
    for (const auto& row : *rows) {
      EXPECT_EQ(row.size(), small_record_columns(number_of(one.type)).size());
    }
  }
  EXPECT_EQ(small_record_rows(number_of(RecordType::temperature), Bytes{0, 1, 0}, std::nullopt),
            (TextRows{{"1", "", "", ""}}));
}

TEST(SmallRecords, AnotherLengthIsRefused) {
  for (const auto& [type, size] :
       {std::pair(RecordType::battery, 1), std::pair(RecordType::battery, 3),
        std::pair(RecordType::event, 0), std::pair(RecordType::heart_rate_bpm, 2),
        std::pair(RecordType::lux, 0), std::pair(RecordType::tag, 14),
        std::pair(RecordType::heart_rate_ant, 6), std::pair(RecordType::capsense, 5),
        std::pair(RecordType::temperature, 4), std::pair(RecordType::temperature, 0)}) {
    SCOPED_TRACE(record_type_name(number_of(type)));
    const Bytes payload(static_cast<std::size_t>(size));
    EXPECT_FAILS(small_record_rows(number_of(type), payload, std::nullopt), ErrorCode::bad_data);
  }
}

}  // namespace
}  // namespace sixpoint::gt3x
