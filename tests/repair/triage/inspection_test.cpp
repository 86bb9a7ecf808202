#include "repair/triage/inspection.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x_made_log.h"
#include "repair/six_sides.h"
#include "repair/triage/survey.h"
#include "shared_data.h"

namespace sixpoint::repair {
namespace {

using gt3x::GapKind;
using gt3x::RecordType;
using namespace gt3x::tests;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

Inspection inspected(const Bytes& log, const std::string& info = made_info()) {
  MemoryFiles files;
  EXPECT_OK(put_recording(files, "in.gt3x", log, info));
  auto found = inspect(files, "in.gt3x");
  EXPECT_OK(found);
  return found.value_or(Inspection{});
}

Inspection inspected(const tests::MadeRecording& made) {
  MemoryFiles files;
  EXPECT_OK(made.write(files, "in.gt3x"));
  auto found = inspect(files, "in.gt3x");
  EXPECT_OK(found);
  return found.value_or(Inspection{});
}

std::vector<std::string> gaps_of(const Inspection& found) {
  std::vector<std::string> gaps;
  for (const InspectedGap& gap : found.gaps) {
    gaps.push_back(std::string(to_string(gap.kind)) + " " + std::to_string(gap.start - kStart) +
                   "+" + std::to_string(gap.seconds));
  }
  return gaps;
}

// A second in which the unit hangs on USB.
void append_usb(Bytes& log, std::uint32_t second) {
  append_record(log, RecordType::activity, kStart + second, Bytes{0});
}

TEST(Inspection, HoldsTheFactsOfTheHeader) {
  const Inspection found = inspected(made_log(5));
  EXPECT_EQ(found.form, "gt3x");
  EXPECT_EQ(found.facts.serial, "MOS2A45130450");
  EXPECT_EQ(found.facts.firmware, "1.5.0");
  EXPECT_EQ(found.facts.calibration_time, from_unix_seconds(1'384'266'733));
  EXPECT_EQ(found.rate_hz, 30);
  EXPECT_EQ(found.accel_scale_lsb_per_g, 256);
  EXPECT_EQ(found.constants, tests::kStored);
  EXPECT_EQ(found.start, kStart);
  EXPECT_EQ(found.samples, 150U);
  EXPECT_EQ(found.end_s, kStart + 5.0);
  EXPECT_EQ(found.duration_s(), 5);
  EXPECT_FALSE(found.already_repaired);
  EXPECT_FALSE(found.problem);
  EXPECT_THAT(found.gaps, IsEmpty());
  EXPECT_THAT(found.warnings, IsEmpty());
  EXPECT_THAT(found.entries, SizeIs(2));
}

TEST(Inspection, ALastRecordThatIsNotFullEndsWithItsSamples) {
  Bytes log = made_log(2);
  append_second(log, 2, 12);
  const Inspection found = inspected(log);
  EXPECT_EQ(found.samples, 72U);
  EXPECT_NEAR(found.duration_s(), 2.4, 1e-6);
}

// One kind of gap each, by hand: 2 to 4 asleep, 6 damaged, 8 to 10 without a reason.
TEST(Inspection, SaysWhyEachGapIsThere) {
  Bytes log = made_log(2);
  append_record(log, RecordType::event, kStart + 2, Bytes{gt3x::kEventEnterIdleSleep});
  append_second(log, 5);
  const std::size_t before = log.size();
  append_second(log, 6);
  log[before + 30] ^= 4;
  append_second(log, 7);
  append_second(log, 11);
  const Inspection found = inspected(log);
  EXPECT_THAT(gaps_of(found), ElementsAre("idle_sleep 2+3", "damaged 6+1", "unexplained 8+3"));
  EXPECT_EQ(found.gap_count, 3U);
  EXPECT_EQ(found.gap_seconds, 7U);
  EXPECT_EQ(found.duration_s(), 12);
  EXPECT_EQ(found.samples, 5U * 30);
  EXPECT_THAT(found.warnings, Contains(HasSubstr("1 records have a wrong checksum")));
}

TEST(Inspection, UsbRecordsAndTheSecondsBehindThemAreOneStretch) {
  Bytes log = made_log(2);
  append_usb(log, 2);
  append_usb(log, 3);
  append_second(log, 10);  // 4 to 9 are missing
  append_usb(log, 11);
  append_second(log, 12);
  append_usb(log, 13);
  const Inspection found = inspected(log);
  EXPECT_THAT(gaps_of(found), ElementsAre("usb 2+8", "usb 11+1", "usb 13+1"));
  EXPECT_EQ(found.gap_count, 3U);
  EXPECT_EQ(found.gap_seconds, 10U);
  EXPECT_EQ(found.duration_s(), 14) << "up to the end of the last gap";
}

TEST(Inspection, TheGapUpToTheLastSampleTimeCounts) {
  const Inspection found =
      inspected(made_log(4), made_info() + "Last Sample Time: 635641850500000000\r\n");
  EXPECT_THAT(gaps_of(found), ElementsAre("unexplained 4+6"));
  EXPECT_EQ(found.duration_s(), 10);
}

TEST(Inspection, ListsSoManyGapsAndCountsAll) {
  Bytes log = made_log(1, 1);
  constexpr std::uint32_t kGaps = gt3x::GapList::kMostListed + 5;
  for (std::uint32_t i = 1; i <= kGaps; ++i) {
    append_second(log, 2 * i, 1);
  }
  const Inspection found = inspected(log, made_info("1"));
  EXPECT_THAT(found.gaps, SizeIs(gt3x::GapList::kMostListed));
  EXPECT_EQ(found.gap_count, kGaps);
  EXPECT_EQ(found.gap_seconds, kGaps);
}

TEST(Inspection, CountsSamplesWithAnAxisAtTheLimit) {
  Bytes log = made_log(1);
  Bytes payload;
  gt3x::append_activity(payload,
                        std::vector<gt3x::Counts>{
                            {2047, 0, 0}, {2046, -2047, 0}, {0, -2048, 0}, {-2048, 2047, 2047}});
  append_record(log, RecordType::activity, kStart + 1, payload);
  EXPECT_EQ(inspected(log).clipped_samples, 3U);
}

// Oracle: each of the six sides by Eq. 1-6 and the constants that the unit stored.
TEST(Inspection, StillPeriodsAreThoseOfTheSixSides) {
  PerAxis<double> min_g{};
  PerAxis<double> max_g{};
  double worst_mg = 0;
  for (const gt3x::Counts& counts : tests::stored_sides()) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      min_g[axis] = std::min(min_g[axis], counts[axis] / 256.0);
      max_g[axis] = std::max(max_g[axis], counts[axis] / 256.0);
    }
    const double length_g = std::hypot(counts[0], counts[1], counts[2]) / 256;
    worst_mg = std::max(worst_mg, 1000 * std::abs(length_g - 1));
  }
  for (const char* firmware : {"1.5.0", "1.6.0"}) {
    tests::MadeRecording made = tests::six_sides();
    made.firmware = firmware;  // 1.6.0 turns the axes; they are judged the right way round
    const Inspection found = inspected(made);
    SCOPED_TRACE(firmware);
    ASSERT_TRUE(found.still);
    EXPECT_EQ(found.still->coverage.blocks, 12U) << "two of four seconds on each side";
    EXPECT_EQ(found.still->magnitude.blocks, 12U);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      EXPECT_NEAR(found.still->coverage.min_g[axis], min_g[axis], 0.004);
      EXPECT_NEAR(found.still->coverage.max_g[axis], max_g[axis], 0.004);
    }
    EXPECT_NEAR(found.still->magnitude.worst_mg, worst_mg, 4);
  }
}

TEST(Inspection, ARepairedFileIsJudgedByItsCountsAlone) {
  MemoryFiles files;
  tests::MadeRecording made = tests::six_sides();
  made.constants = {{256, 256, 256}, {-256, -256, -256}, {0, 0, 0}};
  Bytes log;  // constants that Eq. 1-3 cannot be used with, before right counts
  append_record(log, RecordType::parameters, kStart - 2,
                gt3x::encode_parameters(made_parameters({{5, 5, 5}, {5, 5, 5}, {0, 0, 0}})));
  const Bytes rest = made.log();
  const std::size_t own_parameters = gt3x::kRecordOverhead + made.parameters().size();
  log.insert(log.end(), rest.begin() + static_cast<std::ptrdiff_t>(own_parameters), rest.end());
  for (const bool marked : {false, true}) {
    const std::string path = marked ? "marked.gt3x" : "plain.gt3x";
    auto writer = gt3x::RecordingWriter::create(files, path).value();
    ASSERT_OK(writer.add("log.bin", log));
    ASSERT_OK(writer.add("info.txt", std::string_view(made_info())));
    if (marked) {
      ASSERT_OK(writer.add(kRepairMark, "{}"));
    }
    ASSERT_OK(writer.commit());
    const auto found = inspect(files, path);
    ASSERT_OK(found);
    EXPECT_EQ(found->already_repaired, marked);
    EXPECT_EQ(found->still.has_value(), marked);
    EXPECT_THAT(found->warnings, Contains(HasSubstr("divide by zero")));
    if (!marked) {
      EXPECT_THAT(found->warnings, Contains(HasSubstr("still periods cannot be judged")));
    }
  }
}

// Packed anew without sixpoint-repair.json: the record in the log is still there.
TEST(Inspection, KnowsAMarkThatOutlivedItsEntry) {
  const Bytes log = tests::six_sides().log();
  Bytes marked;
  gt3x::append_record(marked, RecordType::metadata, 7,
                      as_bytes(R"({"MetadataType":"SixpointRepair","Parsed":false,"JSON":null})"));
  marked.insert(marked.end(), log.begin(), log.end());
  EXPECT_TRUE(inspected(marked).already_repaired);
  EXPECT_FALSE(inspected(log).already_repaired);
  // Other METADATA, and our words in a record that is not the first, are no mark.
  Bytes later = log;
  later.insert(later.end(), marked.begin(), marked.end() - static_cast<std::ptrdiff_t>(log.size()));
  EXPECT_FALSE(inspected(later).already_repaired);
  Bytes other;
  gt3x::append_record(other, RecordType::metadata, 7, as_bytes(R"({"MetadataType":"Bio"})"));
  other.insert(other.end(), log.begin(), log.end());
  EXPECT_FALSE(inspected(other).already_repaired);
}

TEST(Inspection, WarnsOfParametersThatDoNotSuffice) {
  Bytes none;
  append_second(none, 0);
  EXPECT_THAT(inspected(none).warnings, ElementsAre(HasSubstr("there are no PARAMETERS")));
  EXPECT_FALSE(inspected(none).constants);

  Bytes late = none;
  append_record(late, RecordType::parameters, kStart + 1,
                gt3x::encode_parameters(made_parameters()));
  append_second(late, 1);
  EXPECT_THAT(inspected(late).warnings,
              Contains(HasSubstr("the first sample has no complete set")));

  Bytes other = made_log(1);
  append_record(other, RecordType::parameters, kStart + 1,
                gt3x::encode_parameters(made_parameters({{1, 2, 3}, {-1, -2, -3}, {0, 0, 0}})));
  append_second(other, 1);
  EXPECT_THAT(inspected(other).warnings, ElementsAre(HasSubstr("repeated with other constants")));
  EXPECT_EQ(inspected(other).constants, tests::kStored) << "those of the first sample";

  Bytes broken = made_log(1);
  append_record(broken, RecordType::parameters, kStart + 1, Bytes{1, 2, 3});
  EXPECT_THAT(inspected(broken).warnings,
              ElementsAre(HasSubstr("1 PARAMETERS records cannot be read")));
}

TEST(Inspection, SaysWhatIsIrregularAboutTheTimes) {
  Bytes log = made_log(3);
  append_second(log, 1);  // repeated
  append_second(log, 4);
  append_second(log, 3);        // out of order
  append_second(log, 5, 31);    // one sample too many
  append_second(log, 300'000);  // a leap
  append_usb(log, 300'001);
  append_second(log, 300'001);  // a one-byte record and samples
  const Inspection found = inspected(log);
  EXPECT_EQ(found.irregular.repeated_seconds(), 1U);
  EXPECT_EQ(found.irregular.records_out_of_order(), 1U);
  EXPECT_EQ(found.irregular.count(gt3x::IrregularKind::odd_size), 1U);
  EXPECT_EQ(found.irregular.count(gt3x::IrregularKind::jump), 1U);
  EXPECT_EQ(found.irregular.count(gt3x::IrregularKind::usb_and_samples), 1U);
  EXPECT_EQ(found.samples, 8U * 30 + 1) << "each second once";
  EXPECT_THAT(gaps_of(found), ElementsAre("unexplained 6+299994"));
  EXPECT_THAT(found.warnings,
              ElementsAre("1 records repeat a second; the first at 2015-04-09T14:04:01",
                          "1 records stand behind later ones; the first at 2015-04-09T14:04:03",
                          HasSubstr("more or fewer samples than the rate"),
                          HasSubstr("times leap back, or forward")));
}

TEST(Inspection, SaysHowFarTheFirstSampleIsFromTheStart) {
  EXPECT_EQ(inspected(made_log(2)).first_after_start_s, 0);
  Bytes shifted;
  append_second(shifted, 1);
  EXPECT_EQ(inspected(shifted).first_after_start_s, 1);
  EXPECT_FALSE(inspected(shifted, "Sample Rate: 30\r\n").first_after_start_s);
}

// What info.txt and PARAMETERS say, and two PARAMETERS.
TEST(Inspection, SaysWhereTheHeadersDisagree) {
  auto values = made_parameters();
  values[gt3x::kParameterSampleRate] = 100;
  values[gt3x::kParameterAccelScale] = gt3x::encode_float(341);
  values[gt3x::kParameterFirmwareVersion] = 0x01060000;
  Bytes log;
  append_record(log, RecordType::parameters, kStart - 1, gt3x::encode_parameters(values));
  append_second(log, 0);
  EXPECT_THAT(inspected(log).warnings,
              ElementsAre(HasSubstr("info.txt says a sample rate of 30 Hz, PARAMETERS of "
                                    "2015-04-09T14:03:59 say 100; info.txt holds"),
                          HasSubstr("an acceleration scale of 256 LSB/g, PARAMETERS of"),
                          HasSubstr("firmware 1.5.0")));
  EXPECT_EQ(inspected(log).facts.other_firmware, "1.6.0");
  values[gt3x::kParameterAccelScale] = gt3x::encode_float(256);
  append_record(log, RecordType::parameters, kStart + 1, gt3x::encode_parameters(values));
  append_second(log, 1);
  EXPECT_THAT(
      inspected(log).warnings,
      Contains(HasSubstr("the PARAMETERS record before says an acceleration scale of 341")));
}

TEST(Inspection, WhatInfoSaysTwiceIsToldAndDecidesNothing) {
  const Inspection found =
      inspected(made_log(5), made_info() +
                                 "Serial Number: MOS2A45130451\r\nFirmware: 1.9.2\r\n"
                                 "Sample Rate: 100\r\nAcceleration Scale: 341\r\n");
  EXPECT_THAT(
      found.warnings,
      ElementsAre(HasSubstr("'Serial Number': MOS2A45130450, which counts, and MOS2A45130451"),
                  HasSubstr("1.9.2"), HasSubstr("'Sample Rate': 30"), HasSubstr("341")));
  EXPECT_EQ(found.facts.other_serial, "MOS2A45130451");
  EXPECT_EQ(found.facts.other_firmware, "1.9.2");
  EXPECT_EQ(found.rate_hz, 30);
}

TEST(Inspection, DamageIsToldWithPlaceAndTimeAndNotForEver) {
  Bytes log = made_log(1);
  const std::size_t place = log.size();
  for (std::uint32_t second = 1; second <= 60; second += 2) {
    log.insert(log.end(), 50, 0x77);
    append_second(log, second);
    append_second(log, second + 1);
  }
  const Inspection found = inspected(log);
  EXPECT_EQ(found.samples, 61U * 30) << "every record between is read";
  ASSERT_THAT(found.warnings, SizeIs(22));
  EXPECT_EQ(found.warnings[0],
            "50 bytes at " + std::to_string(place) +
                " are damaged, between 2015-04-09T14:04:00 and 2015-04-09T14:04:01");
  EXPECT_EQ(found.warnings.back(), "... 30 damaged stretches in all");
}

TEST(Inspection, WhatCanBeReadAndNotUsedIsAProblem) {
  for (const auto& [found, what] :
       {std::pair{inspected(made_log(0)), "no samples"},
        {inspected(made_log(2), made_info("0")), "sample rate"},
        {inspected(made_log(2), made_info("0.5")), "rate"},
        {inspected(made_log(2), "Serial Number: MOS2A45130450\r\n"), "sample rate"}}) {
    ASSERT_TRUE(found.problem) << what;
    EXPECT_EQ(found.problem->code, ErrorCode::bad_data);
    EXPECT_THAT(found.problem->what, HasSubstr(what));
    EXPECT_EQ(found.problem->where, "in.gt3x");
    EXPECT_FALSE(found.problem->hint.empty());
  }
  const Inspection empty = inspected(made_log(0));
  EXPECT_EQ(empty.constants, tests::kStored) << "of the last PARAMETERS, where no sample decides";
  EXPECT_FALSE(empty.start);
  EXPECT_EQ(empty.duration_s(), 0);
}

TEST(Inspection, TheOldFormNeedsASampleRate) {
  MemoryFiles files;
  Bytes activity;
  gt3x::append_activity(activity, std::vector<gt3x::Counts>(45, {0, 0, 256}));
  for (const char* rate : {"30", "0"}) {
    auto writer = gt3x::RecordingWriter::create(files, rate).value();
    ASSERT_OK(writer.add("activity.bin", activity));
    ASSERT_OK(writer.add("info.txt", made_info(rate)));
    ASSERT_OK(writer.commit());
  }
  const auto good = inspect(files, "30");
  ASSERT_OK(good);
  EXPECT_EQ(good->form, "gt3x_old");
  EXPECT_EQ(good->samples, 45U);
  EXPECT_EQ(good->start, kStart) << "Start Date of info.txt";
  EXPECT_EQ(good->duration_s(), 1.5);
  const auto bad = inspect(files, "0");
  EXPECT_FAILS(bad, ErrorCode::bad_data);
  EXPECT_EQ(bad.error().where, "0");
}

// Closed form: two sides at rest, one right, one 20 mg too short.
TEST(Inspection, StillPeriodsOfAnAgdcAreJudgedByItsCalibration) {
  MemoryFiles files;
  const PerAxis<double> offset = {30, -12, 7};
  Bytes log;
  for (std::uint32_t second = 0; second < 40; ++second) {
    const bool up = second < 20;
    const auto z = static_cast<std::int16_t>(offset[2] + (up ? 250 : -245));
    const gt3x::Counts sample = {30, -12, z};
    Bytes payload;
    gt3x::append_activity3(payload, std::vector<gt3x::Counts>(32, sample));
    append_record(log, RecordType::activity3, kStart + second, payload);
  }
  std::string calibration = R"({"isCalibrated":false,"calibrationMethod":2)";
  for (std::size_t a = 0; a < kAxes; ++a) {
    for (std::size_t b = a; b < kAxes; ++b) {
      calibration +=
          fmt::format(",\"sensitivity{}{}_32\":{}", "XYZ"[a], "XYZ"[b], a == b ? 25'000 : 0);
    }
    calibration += fmt::format(",\"offset{}_32\":{}", "XYZ"[a], offset[a]);
  }
  auto writer = gt3x::RecordingWriter::create(files, "a.agdc").value();
  ASSERT_OK(writer.add("log.bin", log));
  ASSERT_OK(writer.add("calibration.json", std::string_view(calibration + "}")));
  ASSERT_OK(writer.add("info.txt", std::string_view("Serial Number: CPW1\r\nSample Rate: 32\r\n"
                                                    "Acceleration Scale: 1\r\n")));
  ASSERT_OK(writer.commit());
  const auto found = inspect(files, "a.agdc");
  ASSERT_OK(found);
  EXPECT_EQ(found->form, "agdc");
  EXPECT_FALSE(found->accel_scale_lsb_per_g);
  ASSERT_TRUE(found->still);
  EXPECT_GE(found->still->magnitude.blocks, 2U);
  EXPECT_NEAR(found->still->coverage.max_g[2], 1, 1e-9);
  EXPECT_NEAR(found->still->coverage.min_g[2], -0.98, 1e-9);
  EXPECT_NEAR(found->still->magnitude.worst_mg, 20, 1e-6);
}

TEST(Inspection, FilesThatCannotBeOpenedAreErrors) {
  MemoryFiles files;
  ASSERT_OK(write_file(files, "empty.gt3x", ""));
  const auto empty = inspect(files, "empty.gt3x");
  EXPECT_FAILS(empty, ErrorCode::bad_data);
  EXPECT_THAT(empty.error().what, HasSubstr("empty"));
  ASSERT_OK(write_file(files, "text.gt3x", "this is no zip archive"));
  EXPECT_FAILS(inspect(files, "none.gt3x"), ErrorCode::no_input);
  EXPECT_FAILS(inspect(files, "text.gt3x"), ErrorCode::bad_data);
  EXPECT_FAILS(inspect(files, "none.agd"), ErrorCode::no_input);
}

// Oracles: what the publishers say of these files (../shared/data/PROVENANCE.md).
TEST(Inspection, RealFiles) {
  SIXPOINT_NEED_SHARED("data");
  const auto of = [](const std::string& name) {
    auto found = inspect(posix_env().files, tests::shared_file("data/" + name));
    EXPECT_OK(found);
    return found.value_or(Inspection{});
  };
  const Inspection old_form = of("nhanes/NEO1B34100019.gt3x");
  EXPECT_EQ(old_form.form, "gt3x_old");
  EXPECT_EQ(old_form.samples, 10'467U);
  EXPECT_EQ(old_form.facts.firmware, "1.4.0");

  const Inspection chamber = of("agdc/CPW1C48210013_baseline.agdc");
  EXPECT_EQ(chamber.form, "agdc");
  EXPECT_FALSE(chamber.accel_scale_lsb_per_g) << "raw counts have no scale";
  EXPECT_NEAR(chamber.duration_s() / 3600, 3.5, 0.1);

  const Inspection epochs = of("agd/example1sec.agd");
  EXPECT_EQ(epochs.form, "agd");
  EXPECT_EQ(epochs.samples, 0U);
  EXPECT_THAT(epochs.warnings, ElementsAre(HasSubstr("an .agd holds epochs")));

  const Inspection clipped = of("gt9x/TAS1H30182785_2019-09-17.gt3x");
  EXPECT_EQ(clipped.clipped_samples, 203U) << "rows of the vendor's own CSV export";
  EXPECT_EQ(clipped.rate_hz, 100);

  // Who set the clocks is in METADATA; the vendor's temperatures of the chamber are labelled UTC.
  EXPECT_EQ(clipped.clock.kind, gt3x::ClockKind::local);
  EXPECT_EQ(clipped.clock.offset_minutes, -240);
  EXPECT_EQ(chamber.clock.kind, gt3x::ClockKind::utc);
  EXPECT_EQ(chamber.clock.offset_minutes, -300);
  EXPECT_EQ(old_form.clock.kind, gt3x::ClockKind::local);
  EXPECT_FALSE(old_form.clock.offset_minutes);
  EXPECT_FALSE(clipped.irregular.any());

  std::uint64_t unexplained_seconds = 0;
  for (const InspectedGap& gap : of("wgt3x-bt-affected/MOS2A45130451.gt3x").gaps) {
    unexplained_seconds += gap.kind == GapKind::unexplained ? gap.seconds : 0;
  }
  EXPECT_EQ(unexplained_seconds, 9956U);
}

}  // namespace
}  // namespace sixpoint::repair
