#include "gap/challenge/recorded.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gap/recording/bundle.h"
#include "gt3x/recording.h"
#include "gt3x_made_log.h"
#include "repair/made_recording.h"
#include "repair/triage/survey.h"

namespace sixpoint::gap {
namespace {

using sim::EffectSpec;
using testing::ElementsAre;
using testing::HasSubstr;

EffectSpec effect(const char* name, const sim::ParameterSet& given = {}) {
  const sim::EffectKind* const kind = *sim::find_effect(name);
  return {kind, *sim::complete_parameters(*kind, given)};
}

// Ten seconds each with X, Y and Z up, of a unit without noise: every count is 0 or 256.
class RecordedTrial : public ::testing::Test {
 protected:
  void SetUp() override { write_bundle(R"("still")"); }

  static Bytes log_of(std::int16_t lsb_per_g) {
    Bytes log;
    for (std::uint32_t second = 0; second < 30; ++second) {
      gt3x::Counts counts{};
      counts[second / 10] = lsb_per_g;
      Bytes payload;
      gt3x::append_activity2(payload, std::vector<gt3x::Counts>(100, counts));
      append_record(log, gt3x::RecordType::activity2, gt3x::tests::kStart + second, payload);
    }
    return log;
  }

  void write_bundle(const std::string& last_kind) {
    const Bytes log = log_of(256);
    ASSERT_OK(files_.make_folders("b"));
    ASSERT_OK(
        gt3x::tests::put_recording(files_, "b/recording.gt3x", log, gt3x::tests::made_info("100")));
    put("b/temperature.csv", "host_time_s,temperature_c\n30,23\n40,23.5\n75,24\n");
    put("b/host_clock.csv", "sample_index,host_time_s\n0,30\n1000,45\n2000,60\n");
    put("b/protocol.json", R"({"schema": "sixpoint/bundle/1", "sample_rate_hz": 100,
      "accel_scale_lsb_per_g": 256, "gravity_g": 1.0, "unit": {}, "segments": [
      {"name": "faces", "kind": "still", "first_sample": 0, "samples": 1000, "host_start_s": 30,
       "rotation": [[0,0,1],[1,0,0],[0,1,0]], "temperature_c": 23},
      {"name": "faces", "kind": "still", "first_sample": 1000, "samples": 1000, "host_start_s": 45,
       "rotation": [[0,1,0],[0,0,1],[1,0,0]], "temperature_c": 23},
      {"name": "last", "first_sample": 2000, "samples": 1000, "host_start_s": 60,
       "rotation": [[1,0,0],[0,1,0],[0,0,1]], "temperature_c": 23, "kind": )" +
                               last_kind + "}]}");
  }
  void put(const std::string& path, const std::string& text) {
    if (files_.info(path)) {
      ASSERT_OK(files_.remove(path));
    }
    ASSERT_OK(write_file(files_, path, text));
  }

  std::vector<gt3x::Counts> counts_of(const std::string& folder) {
    const auto bundle = read_bundle(files_, folder);
    EXPECT_OK(bundle);
    return bundle ? bundle->samples : std::vector<gt3x::Counts>();
  }
  // What the bundle's counts become under these effects.
  std::vector<gt3x::Counts> with(const std::vector<EffectSpec>& effects, std::uint64_t seed = 5) {
    EXPECT_OK(write_recorded_trial(files_, "b", "trial", effects, seed));
    auto counts = counts_of("trial");
    EXPECT_EQ(counts.size(), 3000U);
    counts.resize(3000);
    return counts;
  }
  MemoryFiles files_;
};

// Mean and variance of an axis while the axis `up` points up, LSB.
std::pair<double, double> mean_and_variance(const std::vector<gt3x::Counts>& counts, std::size_t up,
                                            std::size_t axis) {
  double sum = 0;
  double squares = 0;
  for (std::size_t i = up * 1000; i < up * 1000 + 1000; ++i) {
    sum += counts[i][axis];
    squares += counts[i][axis] * counts[i][axis];
  }
  return {sum / 1000, squares / 1000 - sum / 1000 * sum / 1000};
}

TEST_F(RecordedTrial, WithoutEffectsTheCountsStay) { EXPECT_EQ(with({}), counts_of("b")); }

// Oracle: the samples 1200 to 1499 by hand; where nothing is charged, nothing changes.
TEST_F(RecordedTrial, WhatTheFirmwareDoesTouchesNoOtherSample) {
  auto expected = counts_of("b");
  std::fill(expected.begin() + 1200, expected.begin() + 1500, gt3x::Counts{});
  EXPECT_EQ(with({effect("charging_zeros", {{"start_s", {12}}, {"seconds", {3}}})}), expected);
}

// Oracle: the definition, x stored = -y, y stored = x. A fraction that is added and rounded away
// again leaves every count.
TEST_F(RecordedTrial, TurnedAxesAreTheSameCountsInOtherPlaces) {
  auto expected = counts_of("b");
  for (gt3x::Counts& sample : expected) {
    sample = {static_cast<std::int16_t>(-sample[1]), sample[0], sample[2]};
  }
  EXPECT_EQ(with({effect("axis_rotation")}), expected);
}

// Oracle: closed forms. A part d of a count comes out as one count in the share d of the samples:
// mean d, variance d (1 - d), whose mean over all d is the sixth of the header's text.
TEST_F(RecordedTrial, ChangesBelowACountAreKeptOnAverage) {
  const auto counts = with({effect("non_orthogonality", {{"yz_xz_xy", {0, -0.0015, 0.0288}}})});
  const auto [y, y_variance] = mean_and_variance(counts, 0, 1);
  EXPECT_NEAR(y, 256 * 0.0288, 0.08);
  EXPECT_NEAR(y_variance, 0.3728 * 0.6272, 0.03);
  const auto [z, z_variance] = mean_and_variance(counts, 0, 2);
  EXPECT_NEAR(z, 256 * -0.0015, 0.08);
  EXPECT_NEAR(z_variance, 0.384 * 0.616, 0.03);
  const auto [x, x_variance] = mean_and_variance(counts, 0, 0);
  EXPECT_NEAR(x, 256, 0.02) << "gravity along X stays what it was";
  EXPECT_LT(x_variance, 0.05);
}

// Oracle: closed form. Up leans by one degree towards -y of the laboratory.
TEST_F(RecordedTrial, ATiltTurnsGravityOnTopOfWhatWasRecorded) {
  const auto counts = with({effect("tilt", {{"rotation_vector_deg", {1, 0, 0}}})});
  // The unit's axes along the laboratory's y, by the rotations of the protocol.
  const std::array<std::size_t, 3> along_y = {2, 0, 1};
  for (std::size_t up = 0; up < 3; ++up) {
    EXPECT_NEAR(mean_and_variance(counts, up, along_y[up]).first, -256 * std::sin(M_PI / 180),
                0.08);
    EXPECT_NEAR(mean_and_variance(counts, up, up).first, 256 * std::cos(M_PI / 180), 0.08);
    EXPECT_NEAR(mean_and_variance(counts, up, 3 - up - along_y[up]).first, 0, 0.08);
  }
}

TEST_F(RecordedTrial, SameSeedSameBytes) {
  const std::vector<EffectSpec> effects = {effect("seating"), effect("random_walk")};
  const auto written = [&](const std::string& to, std::uint64_t seed) {
    EXPECT_OK(write_recorded_trial(files_, "b", to, effects, seed));
    return read_file(files_, to + "/recording.gt3x").value_or(Bytes{});
  };
  const Bytes first = written("first", 1);
  EXPECT_FALSE(first.empty());
  EXPECT_EQ(first, written("second", 1));
  EXPECT_NE(first, written("third", 2));
}

TEST_F(RecordedTrial, TheRestOfTheBundleIsCopied) {
  (void)with({effect("tilt")});
  for (const std::string name : {"/temperature.csv", "/host_clock.csv", "/protocol.json"}) {
    EXPECT_EQ(read_file(files_, "trial" + name).value_or(Bytes{}), *read_file(files_, "b" + name));
  }
  const auto trial = read_bundle(files_, "trial");
  ASSERT_OK(trial);
  EXPECT_EQ(trial->header.serial, "MOS2A45130450");
  EXPECT_TRUE(trial->losses.empty());
  // A log that is missing stays missing.
  ASSERT_OK(files_.remove("b/host_clock.csv"));
  ASSERT_OK(write_recorded_trial(files_, "b", "without", {}, 1));
  EXPECT_FALSE(files_.info("without/host_clock.csv"));
}

// The header of a trial is that of the recording: its scale and its firmware, too.
TEST_F(RecordedTrial, TheHeaderIsTheRecordings) {
  const auto text = read_file(files_, "b/protocol.json");
  ASSERT_OK(text);
  std::string protocol(text->begin(), text->end());
  protocol.replace(protocol.find("256"), 3, "341");
  put("b/protocol.json", protocol);
  auto info = gt3x::Info::parse(gt3x::tests::made_info("100"));
  ASSERT_OK(info);
  info->set("Acceleration Scale", "341.0");
  info->set("Firmware", "1.9.2");
  ASSERT_OK(files_.remove("b/recording.gt3x"));
  ASSERT_OK(gt3x::tests::put_recording(files_, "b/recording.gt3x", log_of(341), info->serialise()));
  ASSERT_OK(write_recorded_trial(files_, "b", "trial", {effect("tilt")}, 1));
  auto recording = gt3x::Recording::open(files_, "trial/recording.gt3x");
  ASSERT_OK(recording);
  EXPECT_EQ(recording->info().get("Firmware"), "1.9.2");
  EXPECT_EQ(recording->info().get("Acceleration Scale"), "341.0");
}

TEST_F(RecordedTrial, OnlyBundlesAtRestAreTaken) {
  write_bundle(R"("vibration", "vibration": {"direction_lab": [0, 0, 1], "frequency_hz": 9,
                                             "amplitude_g": 0.5})");
  const auto status = write_recorded_trial(files_, "b", "trial", {effect("tilt")}, 1);
  EXPECT_FAILS(status, ErrorCode::usage);
  EXPECT_THAT(status.error().where, HasSubstr("segment last"));
  EXPECT_FAILS(write_recorded_trial(files_, "nowhere", "trial", {}, 1), ErrorCode::no_input);
  put("b/protocol.json", "{}");
  EXPECT_FAILS(write_recorded_trial(files_, "b", "trial", {}, 1), ErrorCode::bad_data);
  EXPECT_FALSE(files_.info("trial/recording.gt3x"));
}

TEST_F(RecordedTrial, EveryEffectOfTheListShowsAtRest) {
  std::set<std::string> seen;
  // On counts that change from sample to sample: to hold a value is no change where none changes.
  const EffectSpec tilt = effect("tilt");
  const auto before = with({tilt});
  for (const std::string& name : effects_for_recordings()) {
    SCOPED_TRACE(name);
    EXPECT_TRUE(seen.insert(name).second);
    const auto kind = sim::find_effect(name);
    ASSERT_OK(kind);
    EXPECT_NE((*kind)->stage, sim::Stage::sampling) << "the times of samples are recorded already";
    EXPECT_TRUE(with({tilt, effect(name.c_str())}) != before) << "nothing was added";
  }
  EXPECT_THAT(effects_for_plain_recordings(), ElementsAre("filter_mismatch"));
}

// A minute with every raw count from -800 to 999, of the unit of MadeRecording.
tests::MadeRecording ramp_recording() {
  tests::MadeRecording made;
  for (int i = 0; i < 1800; ++i) {
    made.raw.push_back({i - 800, 999 - i, (i * 7) % 1800 - 800});
  }
  return made;
}

EffectSpec mismatch() {
  return effect("filter_mismatch", {{"gain", {0.87}}, {"offset_g", {0.13, -0.11, 0.07}}});
}

// Oracle: gain and offset on what Eq. 1-6 make of each raw count, then the firmware's rounding and
// clipping. Below 256 LSB/g no two raw counts are stored as one; above (X and Y of kStored) the
// count that is found again may be its neighbour.
TEST(PlainTrial, TheMismatchActsOnTheRawCounts) {
  const PerAxis<double> offset_g = {0.13, -0.11, 0.07};
  for (const auto& [c, off_lsb] :
       {std::pair{StoredConstants{{246, 270, 303}, {-201, -228, -192}, {61, 4, 61}}, 0.0},
        {tests::kStored, 1.0}}) {
    MemoryFiles files;
    tests::MadeRecording made = ramp_recording();
    made.constants = c;
    ASSERT_OK(made.write(files, "in.gt3x"));
    ASSERT_OK(write_plain_trial(files, "in.gt3x", "out.gt3x", {mismatch()}));
    const auto counts = tests::samples_of(files, "out.gt3x");
    ASSERT_EQ(counts.size(), made.raw.size());
    for (std::size_t i = 0; i < counts.size(); ++i) {
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double g =
            2.0 * (made.raw[i][a] - c.zero_lsb[a]) / (c.positive_lsb[a] - c.negative_lsb[a]);
        const double lsb = std::round(256 * (0.87 * g + offset_g[a]));
        ASSERT_NEAR(counts[i][a], std::clamp(lsb, -2048.0, 2047.0), off_lsb) << i << " axis " << a;
      }
    }
  }
}

// Oracle: gain and offset in the axes as they are stored; one count of rounding twice.
TEST(PlainTrial, ARecordingWithTurnedAxesIsChangedAsStored) {
  MemoryFiles files;
  tests::MadeRecording made = ramp_recording();
  made.firmware = "1.6.0";
  ASSERT_OK(made.write(files, "in.gt3x"));
  ASSERT_OK(write_plain_trial(files, "in.gt3x", "out.gt3x", {mismatch()}));
  const auto before = made.stored();
  const auto counts = tests::samples_of(files, "out.gt3x");
  ASSERT_EQ(counts.size(), before.size());
  const PerAxis<double> offset_g = {0.13, -0.11, 0.07};
  for (std::size_t i = 0; i < counts.size(); ++i) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      ASSERT_NEAR(counts[i][a], 0.87 * before[i][a] + 256 * offset_g[a], 1.01)
          << i << " axis " << a;
    }
  }
}

TEST(PlainTrial, EverythingButTheSamplesStays) {
  MemoryFiles files;
  ASSERT_OK(ramp_recording().write(files, "in.gt3x"));
  ASSERT_OK(write_plain_trial(files, "in.gt3x", "same.gt3x", {}));
  ASSERT_OK(write_plain_trial(files, "in.gt3x", "out.gt3x", {mismatch()}));
  EXPECT_EQ(tests::entry_of(files, "same.gt3x", "log.bin"),
            tests::entry_of(files, "in.gt3x", "log.bin"));
  EXPECT_EQ(tests::entry_of(files, "out.gt3x", "info.txt"),
            tests::entry_of(files, "in.gt3x", "info.txt"));
  EXPECT_EQ(tests::entry_of(files, "out.gt3x", "extra.bin"), (Bytes{1, 2, 3}));
  // PARAMETERS and BATTERY records with their bytes and places; ACTIVITY with its time and size.
  const auto others = [&](const std::string& path) {
    std::vector<Bytes> records;
    auto log = gt3x::Recording::open(files, path)->open_log();
    EXPECT_OK(log);
    for (auto item = log->next(); item && *item; item = log->next()) {
      const gt3x::Record& record = (*item)->record;
      EXPECT_TRUE(record.checksum_ok);
      const std::size_t kept =
          record.is(gt3x::RecordType::activity) ? gt3x::kHeaderSize : record.raw.size();
      records.emplace_back(record.raw.begin(),
                           record.raw.begin() + static_cast<std::ptrdiff_t>(kept));
    }
    return records;
  };
  EXPECT_EQ(others("out.gt3x").size(), 1U + 60 + 6);
  EXPECT_EQ(others("out.gt3x"), others("in.gt3x"));
}

TEST(PlainTrial, OneMismatchIsAllThatCanBeAdded) {
  MemoryFiles files;
  ASSERT_OK(ramp_recording().write(files, "in.gt3x"));
  for (const auto& effects : {std::vector<EffectSpec>{effect("tilt")},
                              {mismatch(), mismatch()},
                              {mismatch(), effect("tilt")}}) {
    const auto status = write_plain_trial(files, "in.gt3x", "out.gt3x", effects);
    EXPECT_FAILS(status, ErrorCode::usage);
    EXPECT_EQ(status.error().where, "in.gt3x");
  }
  EXPECT_FALSE(files.info("out.gt3x"));
}

TEST(PlainTrial, ARecordingWithoutOneSetOfUsableConstantsIsRefused) {
  MemoryFiles files;
  tests::MadeRecording made = ramp_recording();
  made.constants.negative_lsb[1] = made.constants.positive_lsb[1];
  ASSERT_OK(made.write(files, "equal.gt3x"));
  made = ramp_recording();
  made.raw.clear();
  ASSERT_OK(made.write(files, "empty.gt3x"));
  made = ramp_recording();
  tests::MadeRecording other = made;
  other.constants.zero_lsb[0] = 0;
  made.between = [&](std::size_t second) {
    Bytes bytes;
    if (second == 30) {
      append_record(bytes, gt3x::RecordType::parameters, made.start + 30, other.parameters());
    }
    return bytes;
  };
  ASSERT_OK(made.write(files, "two.gt3x"));
  made = ramp_recording();
  auto writer = gt3x::RecordingWriter::create(files, "repaired.gt3x").value();
  ASSERT_OK(writer.add("log.bin", made.log()));
  ASSERT_OK(writer.add("info.txt", gt3x::tests::made_info()));
  ASSERT_OK(writer.add(repair::kRepairMark, "{}"));
  ASSERT_OK(writer.commit());
  ASSERT_OK(write_file(files, "text.gt3x", "this is no zip archive"));
  for (const char* name : {"equal.gt3x", "empty.gt3x", "two.gt3x", "repaired.gt3x", "text.gt3x"}) {
    SCOPED_TRACE(name);
    const auto status = write_plain_trial(files, name, "out.gt3x", {mismatch()});
    EXPECT_FAILS(status, ErrorCode::bad_data);
    EXPECT_THAT(status.error().where, HasSubstr(name));
  }
  EXPECT_FAILS(write_plain_trial(files, "none.gt3x", "out.gt3x", {}), ErrorCode::no_input);
  EXPECT_FALSE(files.info("out.gt3x"));
}

}  // namespace
}  // namespace sixpoint::gap
