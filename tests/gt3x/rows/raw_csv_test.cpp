#include "gt3x/rows/raw_csv.h"

#include <algorithm>
#include <fstream>
#include <numeric>
#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/recording_writer.h"
#include "gt3x_csv_lines.h"
#include "gt3x_made_log.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

using sixpoint::tests::shared_file;
using tests::gunzipped;
using tests::lines_of;

Result<std::string> csv_of(Recording& recording, const RawCsvOptions& options = {},
                           RawCsvTally* tally = nullptr) {
  std::string text;
  const auto written = write_raw_csv(recording, options, [&](std::string_view piece) -> Status {
    text += piece;
    return {};
  });
  if (!written) {
    return fail(written.error());
  }
  if (tally != nullptr) {
    *tally = *written;
  }
  return text;
}

Result<std::string> csv_of(const Bytes& log, const std::string& info,
                           const RawCsvOptions& options = {}, RawCsvTally* tally = nullptr) {
  MemoryEnv memory;
  SIXPOINT_CHECK(tests::put_recording(memory.files, "f", log, info));
  SIXPOINT_ASSIGN(auto recording, Recording::open(memory.files, "f"));
  return csv_of(recording, options, tally);
}

RawCsvOptions with(bool raw_lsb, bool fill) {
  RawCsvOptions options;
  options.raw_lsb = raw_lsb;
  options.fill = fill;
  return options;
}

// The lines below header and column names.
std::vector<std::string> rows_of(const std::string& text) {
  auto lines = lines_of(text);
  lines.erase(lines.begin(), lines.begin() + std::min<std::ptrdiff_t>(11, std::ssize(lines)));
  return lines;
}

// Oracle: the vendor's own export of the same recording, header, line ends and all 240,500 samples,
// of which most are fills: idle sleep with the last sample, USB with zeros.
TEST(RawCsv, EqualsTheVendorsExportByteForByte) {
  SIXPOINT_NEED_SHARED("data/gt9x/TAS1H30182785_2019-09-17.gt3x");
  auto recording =
      Recording::open(posix_env().files, shared_file("data/gt9x/TAS1H30182785_2019-09-17.gt3x"));
  ASSERT_OK(recording);
  RawCsvTally tally;
  const auto text = csv_of(*recording, {}, &tally);
  ASSERT_OK(text);
  const std::string wanted = gunzipped(shared_file("data/gt9x/TAS1H30182785_2019-09-17.csv.gz"));
  ASSERT_EQ(text->size(), wanted.size());
  EXPECT_TRUE(*text == wanted);
  EXPECT_EQ(tally.samples, 33'000U);
  EXPECT_EQ(tally.filled, 240'500U - 33'000U);
}

// Oracle: another export of the vendor's, which its publisher saved again with other line ends and
// empty columns behind the header, and cut after 120 of the 180 seconds; so line by line, without
// trailing commas.
TEST(RawCsv, EqualsTheVendorsExportSampleForSample) {
  SIXPOINT_NEED_SHARED("data/gt9x/TAS1E31150129.gt3x");
  auto recording = Recording::open(posix_env().files, shared_file("data/gt9x/TAS1E31150129.gt3x"));
  ASSERT_OK(recording);
  const auto text = csv_of(*recording);
  ASSERT_OK(text);
  auto wanted = lines_of(gunzipped(shared_file("data/gt9x/exampleRAW.csv.gz")));
  for (auto& line : wanted) {
    line.erase(line.find_last_not_of(',') + 1);
  }
  const auto lines = lines_of(*text);
  ASSERT_EQ(wanted.size(), 11 + 10'800U);
  ASSERT_EQ(lines.size(), 11 + 16'200U);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    ASSERT_EQ(lines[i], wanted[i]) << "line " << i;
  }
}

// Oracle: long division in integers, written differently: the nearest of all multiples of 1 mg, and
// of two equally near ones the one further from zero.
TEST(RawCsv, RoundsHalfAwayFromZeroExactly) {
  for (const std::int64_t scale : {256, 341, 250, 1000}) {
    for (int count = -2048; count <= 2047; ++count) {
      const std::int64_t mg = round_to_mg(count, static_cast<double>(scale));
      // distance of mg * scale from 1000 * count, doubled, in units of 1 / scale mg
      const std::int64_t distance = 2 * std::abs(mg * scale - 1000 * std::int64_t{count});
      ASSERT_LE(distance, scale) << count;
      if (distance == scale) {
        ASSERT_GT(std::abs(mg * scale), std::abs(1000 * std::int64_t{count})) << count;
      }
    }
  }
  EXPECT_EQ(round_to_mg(16, 256), 63);  // 0.0625
  EXPECT_EQ(round_to_mg(-16, 256), -63);
  EXPECT_EQ(round_to_mg(1, 2000), 1);  // 0.0005
  EXPECT_EQ(round_to_mg(0, 256), 0);
  EXPECT_EQ(round_to_mg(32767, 256), 127'996);
}

TEST(RawCsv, FillsAsTheRuleSays) {
  Bytes log;
  const std::vector<Counts> samples = {{256, 0, -16}, {-256, 16, 2047}};
  Bytes payload;
  append_activity(payload, samples);
  append_record(log, RecordType::activity, tests::kStart, payload);
  append_record(log, RecordType::activity, tests::kStart + 2, Bytes{0x5A});
  append_record(log, RecordType::activity, tests::kStart + 4, payload);
  const std::string info = tests::made_info("2") + "Last Sample Time: 635641850460000000\r\n";
  RawCsvTally tally;
  const auto filled = csv_of(log, info, {}, &tally);
  ASSERT_OK(filled);
  EXPECT_EQ(rows_of(*filled),
            (std::vector<std::string>{"1,0,-0.063", "-1,0.063,7.996",         // recorded
                                      "-1,0.063,7.996", "-1,0.063,7.996",     // missing
                                      "0,0,0", "0,0,0", "0,0,0", "0,0,0",     // USB and behind it
                                      "1,0,-0.063", "-1,0.063,7.996",         //
                                      "-1,0.063,7.996", "-1,0.063,7.996"}));  // to the last time
  EXPECT_EQ(tally.filled, 8U);
  const auto plain = csv_of(log, info, with(true, false));
  ASSERT_OK(plain);
  EXPECT_EQ(rows_of(*plain),
            (std::vector<std::string>{"256,0,-16", "-256,16,2047", "256,0,-16", "-256,16,2047"}));
}

TEST(RawCsv, AShortSecondIsFilledUp) {
  Bytes log = tests::made_log(1);
  tests::append_second(log, 1, 28);
  tests::append_second(log, 2);
  RawCsvTally tally;
  const auto text = csv_of(log, tests::made_info(), {}, &tally);
  ASSERT_OK(text);
  EXPECT_EQ(rows_of(*text).size(), 90U);
  EXPECT_EQ(tally.filled, 2U);
  Bytes ends_short = tests::made_log(1);
  tests::append_second(ends_short, 1, 28);
  EXPECT_EQ(rows_of(*csv_of(ends_short, tests::made_info())).size(), 58U);
}

// A minute at 30 Hz, one record per element of `seconds`; 1,800 lines when each is written once.
Bytes log_of(const std::vector<std::uint32_t>& seconds) {
  Bytes log = tests::made_log(0);
  for (const std::uint32_t second : seconds) {
    tests::append_second(log, second);
  }
  return log;
}

std::vector<std::uint32_t> a_minute() {
  std::vector<std::uint32_t> seconds(60);
  std::iota(seconds.begin(), seconds.end(), 0);
  return seconds;
}

struct Lines {
  std::vector<std::string> rows;
  RawCsvTally tally;
};

Lines lines_of_log(const Bytes& log, const RawCsvOptions& options = {},
                   const std::string& info = tests::made_info()) {
  Lines lines;
  const auto text = csv_of(log, info, options, &lines.tally);
  EXPECT_OK(text);
  lines.rows = rows_of(text.value_or(""));
  return lines;
}

TEST(RawCsv, ARepeatedRecordAddsNoLine) {
  const auto whole = lines_of_log(log_of(a_minute()));
  ASSERT_EQ(whole.rows.size(), 1800U);
  auto seconds = a_minute();
  seconds.insert(seconds.begin() + 20, 19);
  const auto lines = lines_of_log(log_of(seconds));
  EXPECT_EQ(lines.rows, whole.rows);
  EXPECT_EQ(lines.tally.irregular.repeated_seconds(), 1U);
  const auto plain = lines_of_log(log_of(seconds), with(false, false));
  EXPECT_EQ(plain.rows.size(), 1830U) << "without filling: what was recorded";
}

TEST(RawCsv, RecordsThatChangedPlacesAndLateOnesComeInTheirPlace) {
  const auto whole = lines_of_log(log_of(a_minute()));
  auto swapped = a_minute();
  std::swap(swapped[20], swapped[21]);
  const auto two = lines_of_log(log_of(swapped));
  EXPECT_EQ(two.rows, whole.rows);
  EXPECT_EQ(two.tally.irregular.records_out_of_order(), 1U);
  auto late = a_minute();
  late.erase(late.begin() + 29);
  late.push_back(29);
  const auto one = lines_of_log(log_of(late));
  EXPECT_EQ(one.rows, whole.rows);
  EXPECT_EQ(one.tally.irregular.records_out_of_order(), 1U);
  EXPECT_EQ(one.tally.filled, 0U);
}

TEST(RawCsv, ARecordThatIsDatedThreeDaysAheadMakesNoMillionsOfLines) {
  auto seconds = a_minute();
  seconds[30] += 3 * 86'400;
  const auto lines = lines_of_log(log_of(seconds));
  EXPECT_EQ(lines.rows.size(), 1800U) << "it stands where it was recorded";
  EXPECT_EQ(lines.tally.irregular.count(IrregularKind::jump), 2U);
  ASSERT_EQ(lines.tally.leap_count, 2U);
  EXPECT_EQ(lines.tally.leaps[0].unix_time, tests::kStart + 30 + 3 * 86'400);
  EXPECT_EQ(lines.tally.leaps[0].seconds, 3 * 86'400);
  EXPECT_EQ(lines.tally.leaps[1].seconds, 1 - 3 * 86'400);
}

TEST(RawCsv, TheFillLimitMovesWhatIsFilled) {
  RawCsvOptions options;
  const Bytes two_hours = log_of({0, 1, 7202});
  EXPECT_EQ(lines_of_log(two_hours).rows.size(), 90U);
  options.fill_limit_s = 7200;
  EXPECT_EQ(lines_of_log(two_hours, options).rows.size(), 7203U * 30);
  const Bytes half_an_hour = log_of({0, 1, 1802});
  EXPECT_EQ(lines_of_log(half_an_hour).rows.size(), 1803U * 30);
  options.fill_limit_s = 1799;
  const auto lowered = lines_of_log(half_an_hour, options);
  EXPECT_EQ(lowered.rows.size(), 90U);
  EXPECT_EQ(lowered.tally.leap_count, 1U);
}

TEST(RawCsv, SleepOfHoursIsFilled) {
  Bytes log = log_of({0, 1});
  append_record(log, RecordType::event, tests::kStart + 2, Bytes{kEventEnterIdleSleep});
  tests::append_second(log, 9000);
  EXPECT_EQ(lines_of_log(log).rows.size(), 9001U * 30);
}

// The form of a real GT3X+ recording of 6,891 seconds at 80 Hz, in which a one-byte record and
// samples share a second: 551,280 lines, one per sample period, and not 80 more.
TEST(RawCsv, ASecondWithAOneByteRecordAndSamplesIsWrittenOnce) {
  constexpr std::uint32_t kSeconds = 6891;
  constexpr std::size_t kRate = 80;
  for (const bool usb_first : {true, false}) {
    Bytes log = tests::made_log(0);
    for (std::uint32_t second = 0; second < kSeconds; ++second) {
      if (usb_first && second == 5000) {
        append_record(log, RecordType::activity, tests::kStart + second, Bytes{0x5A});
      }
      tests::append_second(log, second, kRate);
      if (!usb_first && second == 5000) {
        append_record(log, RecordType::activity, tests::kStart + second, Bytes{0x5A});
      }
    }
    const auto lines = lines_of_log(log, with(true, true), tests::made_info("80"));
    ASSERT_EQ(lines.rows.size(), 551'280U);
    EXPECT_EQ(lines.tally.filled, 0U);
    EXPECT_EQ(lines.tally.irregular.count(IrregularKind::usb_and_samples), 1U);
    const auto expected = tests::samples_of(5000, kRate);
    EXPECT_EQ(lines.rows[5000 * kRate],
              fmt::format("{},{},{}", expected[0][0], expected[0][1], expected[0][2]));
  }
}

// After samples and a one-byte record in one second the unit hangs on USB: zeros.
TEST(RawCsv, BehindSamplesAndAOneByteRecordTheGapIsZeros) {
  Bytes log = log_of({0});
  append_record(log, RecordType::activity, tests::kStart, Bytes{0x5A});
  tests::append_second(log, 2);
  const auto lines = lines_of_log(log);
  ASSERT_EQ(lines.rows.size(), 90U);
  EXPECT_EQ(lines.rows[30], "0,0,0");
  EXPECT_EQ(lines.rows[59], "0,0,0");
}

TEST(RawCsv, ASecondWithMoreSamplesEndsAtTheRate) {
  Bytes log = log_of({0});
  tests::append_second(log, 1, 31);
  tests::append_second(log, 2);
  const auto lines = lines_of_log(log);
  EXPECT_EQ(lines.rows.size(), 90U);
  EXPECT_EQ(lines.tally.surplus_samples, 1U);
  EXPECT_EQ(lines.tally.irregular.count(IrregularKind::odd_size), 1U);
  EXPECT_EQ(lines_of_log(log, with(false, false)).rows.size(), 91U);
}

TEST(RawCsv, Refuses) {
  const auto no_samples = csv_of(tests::made_log(0), tests::made_info());
  EXPECT_FAILS(no_samples, ErrorCode::bad_data);
  EXPECT_THAT(no_samples.error().what, testing::HasSubstr("no samples"));
  EXPECT_FAILS(csv_of(tests::made_log(1), tests::made_info("0")), ErrorCode::bad_data);
  Bytes far = tests::made_log(1);
  append_record(far, RecordType::event, tests::kStart + 1, Bytes{kEventEnterIdleSleep});
  tests::append_second(far, 2'000'000'000);
  const auto leap = csv_of(far, tests::made_info());
  EXPECT_FAILS(leap, ErrorCode::bad_data);
  EXPECT_THAT(leap.error().hint, testing::HasSubstr("--no-fill"));
  EXPECT_OK(csv_of(far, tests::made_info(), with(false, false)));
  Bytes nameless;
  tests::append_second(nameless, 0);
  EXPECT_FAILS(csv_of(nameless, "Serial Number: X\r\nSample Rate: 30\r\n"), ErrorCode::bad_data);
  EXPECT_OK(csv_of(nameless, "Serial Number: X\r\nSample Rate: 30\r\n", with(true, true)));
}

// Oracle: the vendor's calibrated CSV of the same .agdc, to the three decimals that we print.
TEST(RawCsv, RawCountsOfAnAgdcBecomeG) {
  SIXPOINT_NEED_SHARED("data/agdc/WRIST_rawLSB_032Hz_test.agdc");
  auto recording =
      Recording::open(posix_env().files, shared_file("data/agdc/WRIST_rawLSB_032Hz_test.agdc"));
  ASSERT_OK(recording);
  const auto text = csv_of(*recording);
  ASSERT_OK(text);
  const auto rows = rows_of(*text);
  std::ifstream file(shared_file("data/agdc/WRIST_rawCalibrated_032Hz.csv"));
  const auto wanted =
      rows_of(std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()));
  ASSERT_EQ(rows.size(), wanted.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    PerAxis<double> ours{};
    PerAxis<double> theirs{};
    ASSERT_EQ(std::sscanf(rows[i].c_str(), "%lf,%lf,%lf", &ours[0], &ours[1], &ours[2]), 3);
    ASSERT_EQ(std::sscanf(wanted[i].c_str(), "%lf,%lf,%lf", &theirs[0], &theirs[1], &theirs[2]), 3);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      ASSERT_NEAR(ours[axis], theirs[axis], 0.000501) << i;
    }
  }
}

// Of raw counts an .agdc says 1 LSB/g: as a scale of calibrated ones it would make 342 g of 1.34 g.
// Coefficients they need none.
TEST(RawCsv, CalibratedSamplesOfAnAgdcNeedAScale) {
  for (const auto& [has_scale, has_coefficients] :
       {std::pair(false, true), std::pair(true, true), std::pair(true, false)}) {
    MemoryEnv memory;
    Bytes payload;
    append_activity3(payload, std::vector<Counts>(32, Counts{342, 0, 0}));
    Bytes log;
    append_record(log, RecordType::activity3, tests::kStart, payload);
    std::string calibration = R"({"isCalibrated":true,"calibrationMethod":2)";
    for (const char* key : {"offsetX", "offsetY", "offsetZ", "sensitivityXX", "sensitivityYY",
                            "sensitivityZZ", "sensitivityXY", "sensitivityXZ", "sensitivityYZ"}) {
      calibration += has_coefficients ? std::string(",\"") + key + "_32\":25000" : "";
    }
    auto out = RecordingWriter::create(memory.files, "a.agdc").value();
    ASSERT_OK(out.add("log.bin", log));
    ASSERT_OK(out.add("calibration.json", std::string_view(calibration + "}")));
    ASSERT_OK(out.add("info.txt",
                      std::string_view(has_scale ? "Serial Number: CPW1\r\nSample Rate: 32\r\n"
                                                   "Acceleration Scale: 256\r\n"
                                                 : "Serial Number: CPW1\r\nSample Rate: 32\r\n"
                                                   "Acceleration Scale: 1\r\n")));
    ASSERT_OK(out.commit());
    auto recording = Recording::open(memory.files, "a.agdc");
    ASSERT_OK(recording);
    const auto text = csv_of(*recording);
    if (has_scale) {
      ASSERT_OK(text);
      EXPECT_EQ(rows_of(*text).front(), "1.336,0,0");
    } else {
      EXPECT_FAILS(text, ErrorCode::bad_data);
    }
  }
}

// Every recording of the current form that we have can be exported; the oracle for the count is the
// file's own record headers, 30 to 100 samples a second.
TEST(RawCsv, EveryRealRecording) {
  SIXPOINT_NEED_SHARED("data");
  std::size_t files = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(sixpoint::tests::shared_folder() / "data")) {
    const auto ending = entry.path().extension();
    if (ending != ".gt3x" && ending != ".agdc") {
      continue;
    }
    auto recording = Recording::open(posix_env().files, entry.path().string());
    ASSERT_OK(recording);
    RawCsvTally tally;
    const auto text = csv_of(*recording, {}, &tally);
    ASSERT_OK(text);
    EXPECT_EQ(rows_of(*text).size(), tally.samples + tally.filled) << entry.path();
    EXPECT_EQ(tally.checksum_failures + tally.damaged_stretches, 0U);
    ++files;
  }
  EXPECT_EQ(files, 11U);
}

}  // namespace
}  // namespace sixpoint::gt3x
