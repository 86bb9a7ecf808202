#include "gt3x/sample_reader.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/recording_writer.h"
#include "gt3x_made_log.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

using tests::append_second;
using tests::kStart;
using tests::made_info;
using tests::made_log;
using tests::made_parameters;
using tests::samples_of;

struct Run {
  struct Seen {
    SampleItem::Kind kind;
    std::uint32_t time;
    std::uint32_t seconds;
    GapKind gap;
    std::vector<Counts> counts;
    std::optional<StoredConstants> constants;
    bool broke_order;
  };
  std::vector<Seen> items;
  LogStatistics statistics;
  bool constants_changed = false;
  std::size_t parameter_sets = 0;
};

Result<Run> run(Recording& recording) {
  SampleReader reader(recording);
  Run out;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    out.items.push_back({item->kind,
                         item->unix_time,
                         item->seconds,
                         item->gap,
                         {item->counts.begin(), item->counts.end()},
                         item->parameters != nullptr ? item->parameters->constants : std::nullopt,
                         item->broke_order});
  }
  out.statistics = reader.statistics();
  out.constants_changed = reader.constants_changed();
  out.parameter_sets = reader.parameter_sets().size();
  return out;
}

Result<Run> run(const Bytes& log, const std::string& info = made_info()) {
  MemoryEnv memory;
  SIXPOINT_CHECK(tests::put_recording(memory.files, "f", log, info));
  SIXPOINT_ASSIGN(auto recording, Recording::open(memory.files, "f"));
  return run(recording);
}

using Kind = SampleItem::Kind;

TEST(SampleReader, SecondsInOrderWithTheConstantsInForce) {
  const auto result = run(made_log(5));
  ASSERT_OK(result);
  ASSERT_EQ(result->items.size(), 5U);
  for (std::uint32_t i = 0; i < 5; ++i) {
    EXPECT_EQ(result->items[i].time, kStart + i);
    EXPECT_EQ(result->items[i].counts, samples_of(i));
    EXPECT_EQ(result->items[i].constants->zero_lsb, (PerAxis<int>{61, 4, 61}));
  }
}

TEST(SampleReader, GapsAndTheirReasons) {
  Bytes log = made_log(2);
  append_second(log, 5);  // 2, 3, 4 missing: unexplained
  append_record(log, RecordType::event, kStart + 6, Bytes{kEventEnterIdleSleep});
  append_record(log, RecordType::event, kStart + 10, Bytes{9});
  append_second(log, 10);
  append_record(log, RecordType::activity, kStart + 11, Bytes{0x5A});
  append_second(log, 20);
  const std::size_t before = log.size();
  append_second(log, 21);
  log[before + 20] ^= 1;  // its checksum fails: no samples from it
  append_second(log, 22);
  const auto result = run(log, made_info() + "Last Sample Time: 635641850650000000\r\n");
  ASSERT_OK(result);
  std::vector<std::tuple<Kind, std::uint32_t, std::uint32_t>> seen;
  std::vector<GapKind> reasons;
  for (const auto& item : result->items) {
    seen.emplace_back(item.kind, item.time - kStart, item.seconds);
    if (item.kind == Kind::gap) {
      reasons.push_back(item.gap);
    }
  }
  EXPECT_EQ(seen,
            (std::vector<std::tuple<Kind, std::uint32_t, std::uint32_t>>{{Kind::recorded, 0, 1},
                                                                         {Kind::recorded, 1, 1},
                                                                         {Kind::gap, 2, 3},
                                                                         {Kind::recorded, 5, 1},
                                                                         {Kind::gap, 6, 4},
                                                                         {Kind::recorded, 10, 1},
                                                                         {Kind::usb, 11, 1},
                                                                         {Kind::gap, 12, 8},
                                                                         {Kind::recorded, 20, 1},
                                                                         {Kind::gap, 21, 1},
                                                                         {Kind::recorded, 22, 1},
                                                                         {Kind::gap, 23, 2}}));
  EXPECT_EQ(reasons, (std::vector<GapKind>{GapKind::unexplained, GapKind::idle_sleep, GapKind::usb,
                                           GapKind::damaged, GapKind::unexplained}));
  EXPECT_EQ(result->statistics.checksum_failures, 1U);
}

TEST(SampleReader, TheLastParametersBeforeASampleHold) {
  Bytes log = made_log(2);
  const StoredConstants others{{300, 300, 300}, {-200, -200, -200}, {50, 50, 50}};
  append_record(log, RecordType::parameters, kStart + 2,
                encode_parameters(made_parameters(others)));
  append_record(log, RecordType::parameters, kStart + 2,
                encode_parameters(made_parameters(others)));
  append_second(log, 2);
  const auto result = run(log);
  ASSERT_OK(result);
  EXPECT_EQ(result->items[1].constants->zero_lsb, (PerAxis<int>{61, 4, 61}));
  EXPECT_EQ(result->items[2].constants, others);
  EXPECT_TRUE(result->constants_changed);
  EXPECT_EQ(result->parameter_sets, 2U) << "a repetition is no new set";
}

TEST(SampleReader, OfTheFileComesWhatWasRecordedAndTimeThatStepsBackIsMarked) {
  Bytes log = made_log(3);
  append_second(log, 1);
  append_second(log, 9);
  MemoryEnv memory;
  ASSERT_OK(tests::put_recording(memory.files, "f", log));
  auto recording = Recording::open(memory.files, "f");
  ASSERT_OK(recording);
  SampleReader reader(*recording, ReadOrder::of_the_file);
  std::vector<std::pair<std::uint32_t, bool>> seen;
  for (auto item = reader.next(); item && *item; item = reader.next()) {
    seen.emplace_back((*item)->unix_time - kStart, (*item)->broke_order);
  }
  EXPECT_EQ(seen, (std::vector<std::pair<std::uint32_t, bool>>{
                      {0, false}, {1, false}, {2, false}, {1, true}, {9, false}}));
  const auto by_clock = run(log);
  ASSERT_OK(by_clock);
  EXPECT_EQ(by_clock->items.size(), 5U) << "0, 1, 2, a gap, 9";
}

// A clock that was set back before the recording's start: all is read, and the Last Sample Time, by
// the clock as it was, says nothing of what is missing behind it.
TEST(SampleReader, BehindAClockThatWasSetBackNothingIsFilled) {
  Bytes log = made_log(3);
  for (std::uint32_t second = 0; second < 3; ++second) {
    append_second(log, second - 300);
  }
  const auto result = run(log, made_info() + "Last Sample Time: 635641850650000000\r\n");
  ASSERT_OK(result);
  std::vector<std::uint32_t> times;
  for (const auto& item : result->items) {
    EXPECT_EQ(item.kind, Kind::recorded);
    EXPECT_EQ(item.broke_order, item.time == kStart - 300);
    times.push_back(item.time - kStart);
  }
  EXPECT_EQ(times, (std::vector<std::uint32_t>{0, 1, 2, 0U - 300, 0U - 299, 0U - 298}));
}

TEST(SampleReader, NoSamplesNoParameters) {
  EXPECT_TRUE(run(Bytes{})->items.empty());
  Bytes log;
  append_second(log, 0);
  const auto result = run(log);
  ASSERT_OK(result);
  EXPECT_FALSE(result->items[0].constants);
}

TEST(SampleReader, OldFormCountsSecondsFromTheStart) {
  MemoryEnv memory;
  Bytes activity;
  std::vector<Counts> all;
  for (std::uint32_t second = 0; second < 300; ++second) {
    const auto samples = samples_of(second);
    all.insert(all.end(), samples.begin(), samples.end());
  }
  all.resize(all.size() - 13);
  append_activity(activity, all);
  auto out = RecordingWriter::create(memory.files, "f");
  ASSERT_OK(out->add("activity.bin", activity));
  ASSERT_OK(out->add("info.txt", std::string_view(made_info())));
  ASSERT_OK(out->commit());
  auto recording = Recording::open(memory.files, "f");
  ASSERT_OK(recording);
  EXPECT_FALSE(recording->has_log());
  EXPECT_FAILS(recording->open_log(), ErrorCode::bad_data);
  const auto result = run(*recording);
  ASSERT_OK(result);
  ASSERT_EQ(result->items.size(), 300U);
  EXPECT_EQ(result->items[299].time, kStart + 299);
  EXPECT_EQ(result->items[299].counts.size(), 17U);
  EXPECT_EQ(result->items[299].counts[16], samples_of(299)[16]);
}

// Oracle: PROVENANCE of the real recordings (10,467 samples; 205 values at the limit).
TEST(SampleReader, RealOldForm) {
  SIXPOINT_NEED_SHARED("data/nhanes/NEO1B34100019.gt3x");
  auto recording = Recording::open(posix_env().files,
                                   sixpoint::tests::shared_file("data/nhanes/NEO1B34100019.gt3x"));
  ASSERT_OK(recording);
  EXPECT_EQ(recording->info().firmware(), "1.4.0");
  EXPECT_EQ(accel_scale_lsb_per_g(recording->info(), nullptr), 341.0);
  const auto result = run(*recording);
  ASSERT_OK(result);
  std::size_t samples = 0;
  for (const auto& item : result->items) {
    samples += item.counts.size();
  }
  EXPECT_EQ(samples, 10'467U);
}

}  // namespace
}  // namespace sixpoint::gt3x
