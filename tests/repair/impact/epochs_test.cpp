#include "repair/impact/epochs.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
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
    second(20'001 + i);  // behind more than an hour
  }
  const auto series = series_of(made, {}, log);
  ASSERT_OK(series);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> found;
  for (const Epoch& epoch : series->epochs) {
    found.emplace_back(epoch.unix_time - made.start, epoch.samples);
  }
  EXPECT_EQ(found, (std::vector<std::pair<std::uint32_t, std::uint32_t>>{
                       {0, 150}, {5, 150}, {10, 60}, {20, 60}, {25, 150}, {20'001, 150}}));
}

TEST(Epochs, RefusesWhatCannotBe) {
  const MadeRecording made = at(std::vector<PerAxis<int>>(300, {0, 0, 256}));
  EXPECT_FAILS(series_of(made, {.epoch_s = 0}), ErrorCode::usage);
  EXPECT_FAILS(series_of(made, {.epoch_s = 3601}), ErrorCode::usage);
  EXPECT_FAILS(series_of(made, {.epoch_s = 60}), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::repair
