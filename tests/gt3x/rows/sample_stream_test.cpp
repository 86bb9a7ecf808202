#include "gt3x/rows/sample_stream.h"

#include <cstring>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/rows/samples_npy.h"
#include "gt3x_made_log.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::uint32_t kStreamStart = tests::kStart;

Recording opened(MemoryEnv& memory, const Bytes& log) {
  EXPECT_OK(tests::put_recording(memory.files, "f", log));
  auto recording = Recording::open(memory.files, "f");
  EXPECT_OK(recording);
  return *std::move(recording);
}

template <class Row>
std::vector<Row> streamed_in_blocks(SampleStream& stream, std::size_t block) {
  std::vector<Row> rows;
  std::vector<Row> some(block);
  for (;;) {
    const auto got = stream.read(std::span(some));
    EXPECT_OK(got);
    if (!got || *got == 0) {
      return rows;
    }
    rows.insert(rows.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(*got));
  }
}

// What write_samples_npy() says, which has its own writer of values.
template <class Row>
std::vector<Row> array_in_npy(Recording& recording, const RawCsvOptions& options) {
  std::string bytes;
  EXPECT_OK(write_samples_npy(recording, options, [&](std::string_view piece) -> Status {
    bytes += piece;
    return {};
  }));
  const std::size_t header = 10 + static_cast<std::size_t>(static_cast<unsigned char>(bytes.at(8)));
  std::vector<Row> rows((bytes.size() - header) / sizeof(Row));
  std::memcpy(rows.data(), bytes.data() + header, rows.size() * sizeof(Row));
  return rows;
}

Bytes log_with_everything() {
  Bytes log = tests::made_log(3);
  tests::append_second(log, 5, 31);  // two seconds are missing, and a sample is too many
  tests::append_second(log, 6, 12);  // short
  tests::append_second(log, 7);
  append_record(log, RecordType::activity, kStreamStart + 8, Bytes{0});  // USB
  tests::append_second(log, 12);
  ParameterValues other = tests::made_parameters();
  other[kParameterAccelScale] = encode_float(341);
  append_record(log, RecordType::parameters, kStreamStart + 13, encode_parameters(other));
  tests::append_second(log, 13);
  tests::append_second(log, 13 + 100'000);  // too far to be filled
  return log;
}

TEST(SampleStream, HasTheRowsOfTheExportInBlocksOfAnySize) {
  for (const bool fill : {true, false}) {
    MemoryEnv memory;
    Recording recording = opened(memory, log_with_everything());
    RawCsvOptions npy;
    npy.fill = fill;
    const auto expected_g = array_in_npy<PerAxis<float>>(recording, npy);
    npy.raw_lsb = true;
    const auto expected_lsb = array_in_npy<Counts>(recording, npy);
    for (const std::size_t block :
         {std::size_t{1}, std::size_t{7}, std::size_t{30}, std::size_t{5000}}) {
      auto g = SampleStream::open(recording, {false, fill});
      auto lsb = SampleStream::open(recording, {true, fill});
      ASSERT_OK(g);
      ASSERT_OK(lsb);
      EXPECT_EQ(streamed_in_blocks<PerAxis<float>>(*g, block), expected_g) << block << fill;
      EXPECT_EQ(streamed_in_blocks<Counts>(*lsb, block), expected_lsb) << block << fill;
      EXPECT_EQ(g->rows(), expected_g.size());
    }
  }
}

TEST(SampleStream, FillsWithZerosWhereItIsToldTo) {
  MemoryEnv memory;
  Bytes log = tests::made_log(2);
  tests::append_second(log, 4, 12);
  tests::append_second(log, 5);
  Recording recording = opened(memory, log);
  auto stream = SampleStream::open(recording, {true, true, kUsualFillLimit_s, true});
  ASSERT_OK(stream);
  const auto rows = streamed_in_blocks<Counts>(*stream, 100);
  ASSERT_EQ(rows.size(), 6U * 30);
  EXPECT_EQ(rows[59], tests::samples_of(1)[29]);
  EXPECT_EQ(rows[60], Counts{});
  EXPECT_EQ(rows[119], Counts{});
  EXPECT_EQ(rows[4 * 30 + 11], tests::samples_of(4)[11]);
  EXPECT_EQ(rows[4 * 30 + 12], Counts{});
}

TEST(SampleStream, TellsTheTimeOfEveryRow) {
  MemoryEnv memory;
  Recording recording = opened(memory, log_with_everything());
  auto stream = SampleStream::open(recording, {});
  ASSERT_OK(stream);
  const auto rows = streamed_in_blocks<Counts>(*stream, 64);
  // Seconds 0 .. 13 are filled, so they are one run; the jump begins another.
  ASSERT_EQ(stream->runs().size(), 2U);
  EXPECT_EQ(stream->runs()[0].unix_time, kStreamStart);
  EXPECT_EQ(stream->runs()[1].first_row, 14U * 30);
  EXPECT_EQ(stream->runs()[1].unix_time, kStreamStart + 100'013);
  std::vector<std::int64_t> times(rows.size());
  row_times_ns(stream->runs(), 30, 0, times);
  EXPECT_EQ(times[0], std::int64_t{kStreamStart} * 1'000'000'000);
  EXPECT_EQ(times[1], std::int64_t{kStreamStart} * 1'000'000'000 + 33'333'333);
  EXPECT_EQ(times[14 * 30], (std::int64_t{kStreamStart} + 100'013) * 1'000'000'000);
  std::vector<std::int64_t> later(32);
  row_times_ns(stream->runs(), 30, 14 * 30 - 2, later);
  EXPECT_TRUE(std::equal(later.begin(), later.end(), times.begin() + 14 * 30 - 2));
}

TEST(SampleStream, TellsTimesOfWhatWasRecordedWithoutFilling) {
  MemoryEnv memory;
  Recording recording = opened(memory, log_with_everything());
  auto stream = SampleStream::open(recording, {true, false});
  ASSERT_OK(stream);
  const auto rows = streamed_in_blocks<Counts>(*stream, 100);
  EXPECT_EQ(rows.size(), 3U * 30 + 31 + 12 + 4U * 30);
  std::vector<std::int64_t> times(rows.size());
  row_times_ns(stream->runs(), 30, 0, times);
  const auto second = [&](std::size_t row) { return times[row] / 1'000'000'000 - kStreamStart; };
  EXPECT_EQ(second(90), 5);       // behind the gap
  EXPECT_EQ(second(90 + 30), 6);  // the sample too many
  EXPECT_EQ(second(90 + 31), 6);  // its own second begins
  EXPECT_EQ(times[90 + 31] % 1'000'000'000, 0);
  EXPECT_EQ(second(90 + 31 + 12), 7);
}

TEST(SampleStream, NamesScalesAndGaps) {
  MemoryEnv memory;
  Recording recording = opened(memory, log_with_everything());
  auto stream = SampleStream::open(recording, {});
  ASSERT_OK(stream);
  streamed_in_blocks<PerAxis<double>>(*stream, 64);
  ASSERT_EQ(stream->scales().size(), 2U);
  EXPECT_EQ(stream->scales()[0].lsb_per_g, 256);
  EXPECT_EQ(stream->scales()[1].first_row, 13U * 30);
  EXPECT_EQ(stream->scales()[1].lsb_per_g, 341);
  ASSERT_EQ(stream->gaps().listed().size(), 3U);
  EXPECT_EQ(stream->gaps().listed()[1].kind, GapKind::usb);
  EXPECT_EQ(stream->gaps().listed()[1].seconds, 4U);  // the record and the seconds behind it
  SampleReader reader(recording);
  const auto counted = gaps_of(reader);
  ASSERT_OK(counted);
  EXPECT_EQ(counted->seconds(), stream->gaps().seconds());
  EXPECT_EQ(counted->count(), 3U);
}

TEST(SampleStream, ReadsAllRowsIntoMemoryThatGrows) {
  MemoryEnv memory;
  Bytes log = tests::made_log(2);
  tests::append_second(log, 3000);  // filled: far more than the packed form has room for
  Recording recording = opened(memory, log);
  auto stream = SampleStream::open(recording, {});
  ASSERT_OK(stream);
  int asked = 0;
  RowArrayOptions options;
  options.go_on = [&]() -> Status {
    ++asked;
    return {};
  };
  const auto array = read_all_rows(*stream, RowValue::lsb_int16, options);
  ASSERT_OK(array);
  ASSERT_EQ(array->rows, 3001U * 30);
  EXPECT_GT(asked, 0);
  const auto* rows = static_cast<const Counts*>(array->data.get());
  EXPECT_EQ(rows[59], rows[60]);
  EXPECT_EQ(rows[3000 * 30], tests::samples_of(3000)[0]);
}

TEST(SampleStream, StopsAtItsLimitOfMemoryAndWhenItIsToldTo) {
  MemoryEnv memory;
  Bytes log = tests::made_log(2);
  tests::append_second(log, 3000);
  Recording recording = opened(memory, log);
  auto stream = SampleStream::open(recording, {});
  ASSERT_OK(stream);
  const auto too_much = read_all_rows(*stream, RowValue::g_float64, {100'000, {}});
  ASSERT_FALSE(too_much);
  EXPECT_EQ(too_much.error().code, ErrorCode::io);
  auto little = SampleStream::open(recording, {});  // less than the first thousand rows
  ASSERT_OK(little);
  EXPECT_FAILS(read_all_rows(*little, RowValue::g_float64, {500 * 24, {}}), ErrorCode::io);
  Recording short_one = opened(memory, tests::made_log(20));  // 600 rows
  auto rows = SampleStream::open(short_one, {});
  ASSERT_OK(rows);
  EXPECT_FAILS(read_all_rows(*rows, RowValue::g_float64, {500 * 24, {}}), ErrorCode::io);
  auto again = SampleStream::open(recording, {});
  ASSERT_OK(again);
  const auto stopped =
      read_all_rows(*again, RowValue::g_float64,
                    {UINT64_MAX, [] { return Status(fail(ErrorCode::usage, "stop")); }});
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().what, "stop");
}

TEST(SampleStream, OfStoredCountsHasNoRowsInG) {
  MemoryEnv memory;
  Recording recording = opened(memory, tests::made_log(1));
  auto stream = SampleStream::open(recording, {true, true});
  ASSERT_OK(stream);
  std::vector<PerAxis<double>> rows(10);
  EXPECT_FALSE(stream->read(std::span(rows)));
}

TEST(SampleStream, HasTheRowsOfTheExportOfRealRecordings) {
  for (const char* name :
       {"gt9x/TAS1H30182785_2019-09-17.gt3x", "nhanes/NEO1B34100019.gt3x",
        "agdc/WRIST_rawLSB_032Hz_test.agdc", "wgt3x-bt-affected/MOS2A45130451.gt3x"}) {
    SIXPOINT_NEED_SHARED(std::string("data/") + name);
    auto recording = Recording::open(posix_env().files,
                                     sixpoint::tests::shared_file(std::string("data/") + name));
    ASSERT_OK(recording);
    auto stream = SampleStream::open(*recording, {});
    ASSERT_OK(stream);
    EXPECT_EQ(streamed_in_blocks<PerAxis<float>>(*stream, 10'000),
              array_in_npy<PerAxis<float>>(*recording, {}))
        << name;
  }
}

}  // namespace
}  // namespace sixpoint::gt3x
