#include "repair/impact/epochs.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/rows/sample_stream.h"
#include "gt3x_made_log.h"
#include "repair/made_agdc.h"
#include "repair/made_recording.h"

namespace sixpoint::repair {
namespace {

using tests::MadeRecording;

// Counts are raw ones: with these constants 256 of them are 1 g.
constexpr StoredConstants kUnity = {{256, 256, 256}, {-256, -256, -256}, {0, 0, 0}};

MadeRecording at(std::vector<PerAxis<int>> raw) {
  MadeRecording made;
  made.constants = kUnity;
  made.raw = std::move(raw);
  return made;
}

Result<EpochSeries> series_of(const MadeRecording& made, const EpochOptions& options,
                              std::optional<Bytes> log = std::nullopt) {
  MemoryEnv memory;
  EXPECT_OK(log ? made.write(memory.files, "a.gt3x", *log) : made.write(memory.files, "a.gt3x"));
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(memory.files, "a.gt3x"));
  return epochs_of(recording, options);
}

TEST(Epochs, AnAgdcIsTakenWhereItsSamplesAreInG) {
  const auto series_of_agdc = [](const tests::MadeAgdc& made) {
    MemoryEnv memory;
    EXPECT_OK(made.write(memory.files, "a.agdc"));
    auto recording = gt3x::Recording::open(memory.files, "a.agdc").value();
    return epochs_of(recording, {});
  };
  tests::MadeAgdc made;
  EXPECT_FAILS(series_of_agdc(made), ErrorCode::bad_data);
  made.calibrated = true;
  made.coefficients = false;
  const auto series = series_of_agdc(made);
  ASSERT_OK(series);
  EXPECT_EQ(series->epochs.size(), 48U);
  EXPECT_LT(series->epochs[0].enmo_mg, 5) << "at rest, by 256 LSB/g";
}

// Half of the samples at 1.5 g, half at 0.5 g. Oracle: by hand.
TEST(Epochs, EnmoAndMadByHand) {
  std::vector<PerAxis<int>> raw;
  for (int i = 0; i < 300; ++i) {
    raw.push_back({0, 0, i % 2 == 0 ? 384 : 128});
  }
  const auto series = series_of(at(raw), {});
  ASSERT_OK(series);
  ASSERT_EQ(series->epochs.size(), 2U);
  for (const Epoch& epoch : series->epochs) {
    EXPECT_EQ(epoch.samples, 150U);
    EXPECT_NEAR(epoch.enmo_mg, 250, 1e-9) << "the half below 1 g counts as 0";
    EXPECT_NEAR(epoch.mad_mg, 500, 1e-9);
    EXPECT_NEAR(epoch.enmo_per_error[2], 0.5, 1e-12);
    EXPECT_NEAR(epoch.enmo_per_error[0], 0, 1e-12);
    EXPECT_NEAR(epoch.mad_per_error[2], 0, 1e-12) << "an offset moves all alike";
  }
  EXPECT_EQ(series->epochs[1].unix_time, series->epochs[0].unix_time + 5);
}

// Oracle: the same recording with the error put into it.
TEST(Epochs, AnErrorOfAnAxisIsCarriedThrough) {
  std::vector<PerAxis<int>> raw;
  for (int i = 0; i < 1500; ++i) {
    raw.push_back({300 + i % 17, -200 + i % 29, 150 + i % 41});
  }
  const auto plain = series_of(at(raw), {.epoch_s = 50});
  ASSERT_OK(plain);
  ASSERT_EQ(plain->epochs.size(), 1U);
  constexpr int kError_lsb = 2;
  for (std::size_t a = 0; a < kAxes; ++a) {
    auto off = raw;
    for (auto& sample : off) {
      sample[a] += kError_lsb;
    }
    const auto shifted = series_of(at(off), {.epoch_s = 50});
    ASSERT_OK(shifted);
    const double error_mg = 1000.0 * kError_lsb / 256;
    const Epoch& was = plain->epochs[0];
    const Epoch& is = shifted->epochs[0];
    EXPECT_NEAR((is.enmo_mg - was.enmo_mg) / error_mg, was.enmo_per_error[a], 0.01) << a;
    EXPECT_NEAR((is.mad_mg - was.mad_mg) / error_mg, was.mad_per_error[a], 0.01) << a;
  }
}

TEST(Epochs, MissingSecondsLeaveEpochsOut) {
  const MadeRecording made = at(std::vector<PerAxis<int>>(30 * 30, {0, 0, 256}));
  Bytes log;
  gt3x::append_record(log, gt3x::RecordType::parameters, made.start - 1, made.parameters());
  const auto second = [&](std::uint32_t offset) {
    Bytes payload;
    gt3x::append_activity(payload, std::vector<gt3x::Counts>(30, gt3x::Counts{0, 0, 256}));
    gt3x::append_record(log, gt3x::RecordType::activity, made.start + offset, payload);
  };
  for (std::uint32_t i = 0; i < 12; ++i) {
    second(i);  // two epochs and two fifths
  }
  for (std::uint32_t i = 23; i < 30; ++i) {
    second(i);  // 10 to 14 has two seconds, 15 to 19 none, 20 to 24 two, 25 to 29 all
  }
  for (std::uint32_t i = 0; i < 5; ++i) {
    second(20'001 + i);  // behind more than an hour; the last of them is in an epoch that is cut
  }
  const auto series = series_of(made, {}, log);
  ASSERT_OK(series);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> found;
  for (const Epoch& epoch : series->epochs) {
    found.emplace_back(epoch.unix_time - made.start, epoch.samples);
  }
  EXPECT_EQ(found, (std::vector<std::pair<std::uint32_t, std::uint32_t>>{
                       {0, 150}, {5, 150}, {10, 60}, {20, 60}, {25, 150}, {20'000, 120}}));
}

Result<EpochSeries> series_of_log(const Bytes& log, const EpochOptions& options = {}) {
  MemoryEnv memory;
  SIXPOINT_CHECK(gt3x::tests::put_recording(memory.files, "a.gt3x", log));
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(memory.files, "a.gt3x"));
  return epochs_of(recording, options);
}

Bytes log_of(std::initializer_list<std::pair<std::uint32_t, std::uint32_t>> from_to) {
  Bytes log;
  for (const auto& [from, to] : from_to) {
    for (std::uint32_t second = from; second < to; ++second) {
      gt3x::tests::append_second(log, second);
    }
  }
  return log;
}

std::vector<std::pair<std::int64_t, std::uint32_t>> times_and_samples(const EpochSeries& series) {
  std::vector<std::pair<std::int64_t, std::uint32_t>> found;
  for (const Epoch& epoch : series.epochs) {
    found.emplace_back(std::int64_t{epoch.unix_time} - gt3x::tests::kStart, epoch.samples);
  }
  return found;
}

// Ten seconds by a clock that is two hours ahead, the others by the right one. Oracle: the
// recording whose clock was right from the beginning, with those ten seconds last.
TEST(Epochs, NothingIsLostWhereTheClockIsSetBack) {
  const auto set_back = series_of_log(log_of({{7200, 7210}, {0, 60}}));
  const auto right = series_of_log(log_of({{0, 60}, {7200, 7210}}));
  ASSERT_OK(set_back);
  ASSERT_OK(right);
  ASSERT_EQ(right->epochs.size(), 14U);
  ASSERT_EQ(times_and_samples(*set_back), times_and_samples(*right));
  for (std::size_t i = 0; i < 14; ++i) {
    EXPECT_EQ(set_back->epochs[i].enmo_mg, right->epochs[i].enmo_mg) << i;
    EXPECT_EQ(set_back->epochs[i].mad_mg, right->epochs[i].mad_mg) << i;
    EXPECT_EQ(set_back->epochs[i].counts, right->epochs[i].counts) << i;
  }
}

// The clock leaps away in the middle of an epoch, and comes back into it. Oracle: the recording in
// which nothing leapt; of the epoch in two parts, the means by hand.
TEST(Epochs, AnEpochThatTheClockLeapsOutOfIsOneEpoch) {
  const auto leapt = series_of_log(log_of({{0, 12}, {20'001, 20'011}, {12, 25}}));
  const auto whole = series_of_log(log_of({{0, 25}}));
  ASSERT_OK(leapt);
  ASSERT_OK(whole);
  EXPECT_EQ(times_and_samples(*leapt),
            (std::vector<std::pair<std::int64_t, std::uint32_t>>{{0, 150},
                                                                 {5, 150},
                                                                 {10, 150},
                                                                 {15, 150},
                                                                 {20, 150},
                                                                 {20'000, 120},
                                                                 {20'005, 150},
                                                                 {20'010, 30}}));
  ASSERT_EQ(whole->epochs.size(), 5U);
  EXPECT_NEAR(leapt->epochs[2].enmo_mg, whole->epochs[2].enmo_mg, 1e-9);
  for (const std::size_t i : {0U, 1U, 3U, 4U}) {
    EXPECT_EQ(leapt->epochs[i].mad_mg, whole->epochs[i].mad_mg) << i;
  }
  const auto part = [](std::uint32_t from, std::uint32_t to) {  // alone in an epoch of its own
    const auto series = series_of_log(log_of({{from, to}, {from + 10'000, from + 10'001}}));
    return series ? series->epochs.front().mad_mg : -1;
  };
  EXPECT_NEAR(leapt->epochs[2].mad_mg, 0.4 * part(10, 12) + 0.6 * part(12, 15), 1e-9);
}

// Of 1970, where there is no time before the first epoch of the grid.
TEST(Epochs, AClockThatFallsBackTo1970LosesNothing) {
  Bytes log = log_of({{0, 10}});
  for (std::uint32_t i = 1; i < 20; ++i) {
    Bytes payload;
    gt3x::append_activity(payload, gt3x::tests::samples_of(i));
    gt3x::append_record(log, gt3x::RecordType::activity, i, payload);
  }
  const auto series = series_of_log(log, {.epoch_s = 7});
  ASSERT_OK(series);
  // 1'428'588'240 is 2 more than a multiple of 7: epochs begin at -5, 2, 9 and 16.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> found;
  for (const Epoch& epoch : series->epochs) {
    found.emplace_back(epoch.unix_time, epoch.samples / 30);
  }
  EXPECT_EQ(found,
            (std::vector<std::pair<std::uint32_t, std::uint32_t>>{
                {0, 1}, {2, 7}, {9, 7}, {gt3x::tests::kStart, 7}, {gt3x::tests::kStart + 7, 3}}));
}

// 90 s, then the unit sleeps or hangs on USB, then 90 s; within an epoch, by less and by more than
// an hour. Oracle: the counts of the rows of the CSV, one after the other.
TEST(Epochs, CountsAreThoseOfTheCsvBehindIdleSleepAndUsb) {
  constexpr int kEpoch_s = 20;
  for (const bool usb : {false, true}) {
    for (const std::uint32_t behind : {200U, 1875U, 5490U}) {
      Bytes log = log_of({{0, 90}});
      gt3x::append_record(log, usb ? gt3x::RecordType::activity : gt3x::RecordType::event,
                          gt3x::tests::kStart + 90, Bytes{8});
      for (std::uint32_t second = behind; second < behind + 90; ++second) {
        gt3x::tests::append_second(log, second);
      }
      MemoryEnv memory;
      ASSERT_OK(gt3x::tests::put_recording(memory.files, "a.gt3x", log));
      auto recording = gt3x::Recording::open(memory.files, "a.gt3x");
      ASSERT_OK(recording);
      auto stream = gt3x::SampleStream::open(*recording, {});
      ASSERT_OK(stream);
      std::vector<PerAxis<double>> rows((behind + 90) * std::size_t{30});
      const auto count = stream->read(std::span(rows));
      ASSERT_OK(count);
      ASSERT_EQ(*count, rows.size());
      std::map<std::uint32_t, PerAxis<int>> expected;
      for (std::size_t a = 0; a < kAxes; ++a) {
        ActivityCounts counts(30, kEpoch_s, CountFilter::normal);
        std::uint32_t begin = 0;
        for (const PerAxis<double>& row : rows) {
          if (const auto of_epoch = counts.push(row[a])) {
            expected[begin][a] = *of_epoch;
            begin += kEpoch_s;
          }
        }
      }
      const auto series = epochs_of(*recording, {.epoch_s = kEpoch_s});
      ASSERT_OK(series);
      std::uint32_t samples = 0;
      for (const Epoch& epoch : series->epochs) {
        samples += epoch.samples;
        const std::uint32_t begin = epoch.unix_time - gt3x::tests::kStart;
        ASSERT_TRUE(expected.contains(begin)) << begin;
        EXPECT_EQ(epoch.counts, expected[begin]) << begin << ' ' << behind << ' ' << usb;
        EXPECT_GT(epoch.counts[0], 0) << begin;
      }
      const std::uint32_t cut = (behind + 90) % kEpoch_s;
      EXPECT_EQ(samples, 30 * (180 - cut)) << behind;
    }
  }
}

// The filter need not go through them one by one.
TEST(Epochs, ThirtyYearsOfIdleSleepAreSkipped) {
  Bytes log = log_of({{0, 10}});
  gt3x::append_record(log, gt3x::RecordType::event, gt3x::tests::kStart + 10, Bytes{8});
  constexpr std::uint32_t kThirtyYears_s = 30U * 365 * 86'400;
  for (std::uint32_t i = 0; i < 10; ++i) {
    gt3x::tests::append_second(log, kThirtyYears_s + i);
  }
  const auto series = series_of_log(log);
  ASSERT_OK(series);
  EXPECT_EQ(times_and_samples(*series),
            (std::vector<std::pair<std::int64_t, std::uint32_t>>{
                {0, 150}, {5, 150}, {kThirtyYears_s, 150}, {kThirtyYears_s + 5, 150}}));
}

TEST(Epochs, RefusesWhatCannotBe) {
  const MadeRecording made = at(std::vector<PerAxis<int>>(300, {0, 0, 256}));
  EXPECT_FAILS(series_of(made, {.epoch_s = 0}), ErrorCode::usage);
  EXPECT_FAILS(series_of(made, {.epoch_s = 3601}), ErrorCode::usage);
  EXPECT_FAILS(series_of(made, {.epoch_s = 60}), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::repair
