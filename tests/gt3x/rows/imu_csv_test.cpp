#include "gt3x/rows/imu_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x_csv_lines.h"
#include "gt3x_made_log.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

using sixpoint::tests::shared_file;
using tests::gunzipped;
using tests::lines_of;

Result<std::pair<std::string, ImuCsvTally>> imu_of(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto recording, Recording::open(files, path));
  std::string text;
  SIXPOINT_ASSIGN(const auto tally, write_imu_csv(recording, [&](std::string_view piece) {
                    text += piece;
                    return Status();
                  }));
  return std::pair(text, tally);
}

// Oracle: the vendor's own CSV of the same recording, its first 23 seconds, two of which hold 101
// samples.
TEST(ImuCsv, IsTheVendorsLineForLine) {
  SIXPOINT_NEED_SHARED("data/gt9x/TAS1E31150129.gt3x");
  const auto ours = imu_of(posix_env().files, shared_file("data/gt9x/TAS1E31150129.gt3x"));
  ASSERT_OK(ours);
  const auto lines = lines_of(ours->first);
  const auto theirs = lines_of(gunzipped(shared_file("data/gt9x/example-IMU.csv.gz")));
  ASSERT_EQ(theirs.size(), 2311U);
  std::size_t different = 0;
  for (std::size_t i = 10; i < theirs.size(); ++i) {
    if (lines.at(i) != theirs[i]) {
      EXPECT_LT(++different, 5U) << lines[i] << "\n" << theirs[i];
    }
  }
  EXPECT_EQ(different, 0U);
  EXPECT_EQ(ours->second.seconds, 179U);
  EXPECT_EQ(lines.size(), 11 + 179 * 100U);
  EXPECT_EQ(ours->second.resampled_seconds, 16U);
  EXPECT_EQ(ours->second.unreadable_records, 0U);
}

// One column of one byte, so that what a second of another length becomes can be seen.
void append_schema(Bytes& log, std::uint8_t id, std::string label = "Count") {
  Bytes schema = {id, 0, 1, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0};
  label.resize(16, ' ');
  schema.insert(schema.end(), label.begin(), label.end());
  append_record(log, RecordType::sensor_schema, tests::kStart, schema);
}

Bytes made_imu_log(const std::vector<std::size_t>& samples_per_second) {
  Bytes log;
  append_schema(log, 1);
  for (std::uint32_t second = 0; second < samples_per_second.size(); ++second) {
    Bytes payload = {1, 0};
    for (std::size_t i = 0; i < samples_per_second[second]; ++i) {
      payload.push_back(static_cast<std::uint8_t>(i));
    }
    append_record(log, RecordType::sensor_data, tests::kStart + second, payload);
  }
  return log;
}

// Closed form: with counts 0, 1, 2 ... the j-th line of a second of n samples is j * n / 100, and
// never beyond the last sample.
TEST(ImuCsv, ASecondOfAnotherLengthIsInterpolated) {
  for (const std::size_t n :
       {std::size_t{1}, std::size_t{99}, std::size_t{100}, std::size_t{101}}) {
    MemoryEnv memory;
    ASSERT_OK(tests::put_recording(memory.files, "a.gt3x", made_imu_log({n})));
    const auto csv = imu_of(memory.files, "a.gt3x");
    ASSERT_OK(csv);
    const auto lines = lines_of(csv->first);
    ASSERT_EQ(lines.size(), 111U);
    EXPECT_EQ(lines[10], "Timestamp,Count");
    for (std::size_t j = 0; j < 100; ++j) {
      const double expected =
          std::min(static_cast<double>(j * n) / 100, static_cast<double>(n - 1));
      const std::string value = lines[11 + j].substr(lines[11 + j].find(',') + 1);
      EXPECT_NEAR(std::stod(value), expected, 1e-6) << n << " " << j;
    }
    EXPECT_THAT(lines[12], testing::StartsWith("2015-04-09T14:04:00.0100000,"));
    EXPECT_EQ(csv->second.resampled_seconds, n == 100 ? 0U : 1U);
  }
}

TEST(ImuCsv, WhatCannotBeReadIsCountedAndLeftOut) {
  MemoryEnv memory;
  Bytes log = made_imu_log({100, 100});
  append_record(log, RecordType::sensor_data, tests::kStart + 2, Bytes{9, 0, 1});  // no such schema
  append_record(log, RecordType::sensor_schema, tests::kStart + 2, Bytes{1, 0});
  append_record(log, RecordType::sensor_data, tests::kStart + 3, Bytes{1, 0});  // no samples
  append_record(log, RecordType::sensor_data, tests::kStart + 4, Bytes{1, 0, 5});
  log.back() ^= 1;  // its checksum
  ASSERT_OK(tests::put_recording(memory.files, "a.gt3x", log));
  const auto csv = imu_of(memory.files, "a.gt3x");
  ASSERT_OK(csv);
  EXPECT_EQ(csv->second.seconds, 2U);
  EXPECT_EQ(csv->second.unreadable_records, 4U);
}

// A second of one sample, by each of the schemas in turn. Left out is only what has other columns.
TEST(ImuCsv, SeveralSchemasOfTheSameColumnsAreRead) {
  MemoryEnv memory;
  Bytes log;
  append_schema(log, 0);
  append_schema(log, 1);
  append_schema(log, 2, "Other");
  for (std::uint8_t second = 0; second < 6; ++second) {
    const auto id = static_cast<std::uint8_t>(second % 3);
    append_record(log, RecordType::sensor_data, tests::kStart + second, Bytes{id, 0, second});
  }
  append_schema(log, 1, "Other");  // from here on
  append_record(log, RecordType::sensor_data, tests::kStart + 6, Bytes{1, 0, 6});
  ASSERT_OK(tests::put_recording(memory.files, "a.gt3x", log));
  const auto csv = imu_of(memory.files, "a.gt3x");
  ASSERT_OK(csv);
  EXPECT_EQ(csv->second.seconds, 4U);
  EXPECT_EQ(csv->second.other_columns, 3U);
  EXPECT_EQ(csv->second.unreadable_records, 0U);
  const auto lines = lines_of(csv->first);
  ASSERT_EQ(lines.size(), 11 + 4 * 100U);
  EXPECT_EQ(lines[11], "2015-04-09T14:04:00.0000000,0");
  EXPECT_EQ(lines[111], "2015-04-09T14:04:01.0000000,1");
  EXPECT_EQ(lines[211], "2015-04-09T14:04:03.0000000,3");
  EXPECT_EQ(lines[311], "2015-04-09T14:04:04.0000000,4");
}

TEST(ImuCsv, ASchemaMoreThanSixtyFourIsLeftOut) {
  MemoryEnv memory;
  Bytes log;
  for (std::uint8_t id = 0; id < 65; ++id) {
    append_schema(log, id);
  }
  append_record(log, RecordType::sensor_data, tests::kStart, Bytes{63, 0, 1});
  append_record(log, RecordType::sensor_data, tests::kStart + 1, Bytes{64, 0, 1});
  ASSERT_OK(tests::put_recording(memory.files, "a.gt3x", log));
  const auto csv = imu_of(memory.files, "a.gt3x");
  ASSERT_OK(csv);
  EXPECT_EQ(csv->second.seconds, 1U);
  EXPECT_EQ(csv->second.unreadable_records, 2U);
}

TEST(ImuCsv, ARecordingWithoutTheSensorIsRefused) {
  MemoryEnv memory;
  ASSERT_OK(tests::put_recording(memory.files, "a.gt3x", tests::made_log(3)));
  EXPECT_FAILS(imu_of(memory.files, "a.gt3x"), ErrorCode::bad_data);
  ASSERT_OK(tests::put_recording(memory.files, "b.gt3x", made_imu_log({})));
  EXPECT_FAILS(imu_of(memory.files, "b.gt3x"), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::gt3x
