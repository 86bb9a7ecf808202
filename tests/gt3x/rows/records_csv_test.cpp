#include "gt3x/rows/records_csv.h"

#include <cmath>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/recording_writer.h"
#include "gt3x_csv_lines.h"
#include "gt3x_made_log.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

using sixpoint::tests::shared_file;
using tests::lines_of;

struct Records {
  std::vector<std::string> lines;
  RecordsCsvTally tally;
};

Result<Records> records_of(FileSystem& files, const std::string& path, RecordType type) {
  SIXPOINT_ASSIGN(auto recording, Recording::open(files, path));
  std::string text;
  SIXPOINT_ASSIGN(const auto tally, write_records_csv(recording, static_cast<std::uint8_t>(type),
                                                      [&](std::string_view piece) {
                                                        text += piece;
                                                        return Status();
                                                      }));
  return Records{lines_of(text), tally};
}

TEST(RecordsCsv, ALinePerRecordOfTheType) {
  MemoryEnv memory;
  Bytes log = tests::made_log(3);
  append_record(log, RecordType::lux, tests::kStart + 3, Bytes{1});  // too short
  append_record(log, RecordType::lux, tests::kStart + 3, Bytes{1, 0});
  log.back() ^= 1;  // its checksum
  ASSERT_OK(tests::put_recording(memory.files, "a.gt3x", log));
  const auto lux = records_of(memory.files, "a.gt3x", RecordType::lux);
  ASSERT_OK(lux);
  EXPECT_EQ(lux->lines,
            (std::vector<std::string>{"time,unix_s,lux", "2015-04-09T14:04:00,1428588240,7",
                                      "2015-04-09T14:04:01,1428588241,7",
                                      "2015-04-09T14:04:02,1428588242,7"}));
  EXPECT_EQ(lux->tally.records, 3U);
  EXPECT_EQ(lux->tally.unreadable_records, 2U);
  EXPECT_EQ(records_of(memory.files, "a.gt3x", RecordType::battery)->lines,
            (std::vector<std::string>{"time,unix_s,battery_v"}));
}

// Oracle: the vendor's CSV of both sensors, in degrees and as read, of 3.5 hours in a chamber.
TEST(RecordsCsv, TemperaturesAreTheVendors) {
  SIXPOINT_NEED_SHARED("data/agdc/CPW1C48210013_baseline.agdc");
  const auto ours =
      records_of(posix_env().files, shared_file("data/agdc/CPW1C48210013_baseline.agdc"),
                 RecordType::temperature);
  ASSERT_OK(ours);
  struct Theirs {
    const char* file;
    std::size_t column;
  };
  for (const Theirs& theirs :
       {Theirs{"Csv_ADC/CPW1C48210013_baseline_temperature_MCU_ADC.csv", 2},
        Theirs{"Csv_ADC/CPW1C48210013_baseline_temperature_ADXL_ADC.csv", 3},
        Theirs{"Csv_Calibrated/CPW1C48210013_baseline_temperature_MCU_calibrated.csv", 4},
        Theirs{"Csv_Calibrated/CPW1C48210013_baseline_temperature_ADXL_calibrated.csv", 5}}) {
    std::ifstream file(shared_file(std::string("data/agdc/") + theirs.file));
    const auto wanted = lines_of(std::string(std::istreambuf_iterator<char>(file), {}));
    ASSERT_EQ(wanted.size(), ours->lines.size()) << theirs.file;
    for (std::size_t i = 1; i < wanted.size(); ++i) {
      const std::size_t comma = wanted[i].find(',');
      std::vector<std::string> values;
      std::istringstream row(ours->lines[i]);
      for (std::string value; std::getline(row, value, ',');) {
        values.push_back(value);
      }
      ASSERT_EQ(values.size(), 6U);
      ASSERT_EQ(std::stod(wanted[i].substr(0, comma)), std::stod(values[1]));
      ASSERT_NEAR(std::stod(wanted[i].substr(comma + 1)), std::stod(values[theirs.column]), 1e-12)
          << theirs.file << " line " << i;
    }
  }
}

// As `export --time` has them: a Z where the recording's clock is UTC, which raw counts tell.
TEST(RecordsCsv, TimesByUtcAreSaidToBe) {
  MemoryEnv memory;
  Bytes log;
  append_record(log, RecordType::battery, tests::kStart, Bytes{0x68, 0x10});
  append_record(log, RecordType::activity3, tests::kStart, Bytes(9));
  ASSERT_OK(tests::put_recording(memory.files, "a.agdc", log));
  const auto battery = records_of(memory.files, "a.agdc", RecordType::battery);
  ASSERT_OK(battery);
  EXPECT_EQ(battery->lines, (std::vector<std::string>{"time,unix_s,battery_v",
                                                      "2015-04-09T14:04:00Z,1428588240,4.2"}));
}

// Oracle: the example of the vendor's description (lux.bin.md): 0, 19, 65535, 2200 and 1100 of a
// GT3X+ are 0, 0, 0, 2500 and 1375 lux. What the readings of another unit are is not public.
TEST(RecordsCsv, TheOldFormHasItsLuxInAFileOfItsOwn) {
  using testing::ElementsAre;
  MemoryEnv memory;
  const auto values_of = [&](const std::string& serial) {
    std::string info = tests::made_info();
    info.replace(info.find("MOS2A45130450"), serial.size(), serial);
    auto out = RecordingWriter::create(memory.files, "old.gt3x").value();
    EXPECT_OK(out.add("activity.bin", Bytes(9)));
    EXPECT_OK(out.add("lux.bin",
                      Bytes{0x00, 0x00, 0x13, 0x00, 0xFF, 0xFF, 0x98, 0x08, 0x4C, 0x04, 0x4C}));
    EXPECT_OK(out.add("info.txt", std::string_view(info)));
    EXPECT_OK(out.commit());
    const auto lux = records_of(memory.files, "old.gt3x", RecordType::lux).value();
    EXPECT_EQ(lux.tally.unreadable_records, 1U);
    std::vector<std::string> values;
    for (const std::string& line : lux.lines) {
      values.push_back(line.substr(line.rfind(',') + 1));
    }
    return values;
  };
  EXPECT_THAT(values_of("NEO1C16110020"), ElementsAre("lux", "0", "0", "0", "2500", "1375"));
  EXPECT_THAT(values_of("MRA1C16110020"), ElementsAre("lux", "0", "0", "0", "6000", "3575"));
  EXPECT_THAT(values_of("CLE1C16110020"),
              ElementsAre("lux_raw", "0", "19", "65535", "2200", "1100"));
  EXPECT_FAILS(records_of(memory.files, "old.gt3x", RecordType::battery), ErrorCode::bad_data);
}

// Oracle: the file's own count of seconds, 10,467 samples at 80 Hz.
// Readings of the same file by hand: 84 10 is 4.228 V.
TEST(RecordsCsv, BatteryOfARealOldRecording) {
  SIXPOINT_NEED_SHARED("data/nhanes/NEO1B34100019.gt3x");
  const auto battery = records_of(posix_env().files, shared_file("data/nhanes/NEO1B34100019.gt3x"),
                                  RecordType::battery);
  ASSERT_OK(battery);
  EXPECT_EQ(battery->tally.records, 4U);
  EXPECT_EQ(battery->tally.unreadable_records, 0U);
  EXPECT_EQ(battery->lines[1], "2010-10-26T13:31:00,1288099860,4.228");
}

TEST(RecordsCsv, LightOfARealOldRecording) {
  SIXPOINT_NEED_SHARED("data/nhanes/NEO1B34100019.gt3x");
  const auto lux =
      records_of(posix_env().files, shared_file("data/nhanes/NEO1B34100019.gt3x"), RecordType::lux);
  ASSERT_OK(lux);
  EXPECT_GT(lux->tally.records, 100U);
  EXPECT_EQ(lux->tally.unreadable_records, 0U);
}

}  // namespace
}  // namespace sixpoint::gt3x
