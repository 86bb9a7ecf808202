#include "repair/triage/survey.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/made_agdc.h"
#include "repair/old_form.h"
#include "repair/six_sides.h"
#include "repair/triage/inspection.h"
#include "shared_data.h"

namespace sixpoint::repair {
namespace {

// A unit is calibrated before it records.
TEST(Survey, ADateOfCalibrationBehindTheRecordingIsNone) {
  tests::MadeRecording made = tests::six_sides();
  made.info_says_start = true;
  const auto facts_with = [&](std::int64_t calibrated) {
    MemoryFiles files;
    made.calibrated = calibrated;
    EXPECT_TRUE(made.write(files, "in.gt3x"));
    const auto found = survey(files, "in.gt3x");
    const auto facts = facts_of(files, "in.gt3x");
    EXPECT_TRUE(found && facts);
    EXPECT_EQ(facts->calibration_time, found->facts.calibration_time);
    return found->facts;
  };
  constexpr std::int64_t kDay_s = 86'400;
  const std::int64_t start = made.start;
  EXPECT_EQ(date_of_constants(facts_with(start + kDay_s)), from_unix_seconds(start + kDay_s));
  for (const std::int64_t impossible : {start + kDay_s + 1, std::int64_t{0xFFFFFFFF}}) {
    const FileFacts facts = facts_with(impossible);
    EXPECT_FALSE(date_of_constants(facts)) << impossible;
    EXPECT_EQ(facts.calibration_time, from_unix_seconds(impossible)) << "as the file says it";
    EXPECT_EQ(filter_of_constants(facts), std::nullopt);
    EXPECT_EQ(triage(facts).verdict, Verdict::cannot_tell);
    EXPECT_NE(triage(facts).reasons[0].find("after it was recorded"), std::string::npos);
  }
  made.start = 0;  // a clock that was never set says nothing about the other
  EXPECT_EQ(date_of_constants(facts_with(1'395'619'200)), from_unix_seconds(1'395'619'200));
}

// The table of Survey::agdc, a row each. Oracle: the unit was made to fit its offset and matrix; by the
// six-point entries of calibration.json it is more than 200 mg from 1 g. inspect says the same.
TEST(Survey, AnAgdcIsJudgedByWhatIsApplied) {
  MemoryFiles files;
  const auto found_of = [&](const tests::MadeAgdc& made) {
    EXPECT_OK(made.write(files, "in.agdc"));
    return survey(files, "in.agdc").value();
  };
  tests::MadeAgdc made;
  const Survey raw = found_of(made);
  EXPECT_TRUE(raw.raw_counts);
  ASSERT_TRUE(raw.agdc);
  EXPECT_GE(raw.magnitude.blocks, 40U);
  EXPECT_LT(raw.magnitude.worst_mg, 2);
  EXPECT_DOUBLE_EQ(raw.magnitude.p95_mg, inspect(files, "in.agdc")->still->magnitude.p95_mg);
  made.calibration = false;
  const Survey unknown = found_of(made);
  EXPECT_TRUE(unknown.raw_counts);
  EXPECT_FALSE(unknown.agdc);
  made.calibration = true;
  made.calibrated = true;
  for (const bool coefficients : {true, false}) {
    made.coefficients = coefficients;
    const Survey calibrated = found_of(made);
    EXPECT_FALSE(calibrated.raw_counts);
    ASSERT_TRUE(calibrated.agdc && calibrated.agdc->already_applied);
    EXPECT_GE(calibrated.magnitude.blocks, 40U);
    EXPECT_LT(calibrated.magnitude.worst_mg, 2);
    ASSERT_TRUE(calibrated.constants_problem);
    EXPECT_NE(calibrated.constants_problem->what.find("calibrated before they were written"),
              std::string::npos);
  }
  made.scale_lsb_per_g = 1;  // as of raw counts
  EXPECT_TRUE(found_of(made).raw_counts);
}

TEST(Survey, SaysWhatTheFileHolds) {
  MemoryFiles files;
  const tests::MadeRecording made = tests::six_sides();
  ASSERT_OK(made.write(files, "in.gt3x"));
  const auto found = survey(files, "in.gt3x");
  ASSERT_OK(found);
  EXPECT_EQ(found->facts.serial, "MOS2A45130450");
  EXPECT_EQ(found->facts.firmware, "1.5.0");
  EXPECT_EQ(found->facts.calibration_time, from_unix_seconds(1'384'266'733));
  EXPECT_EQ(found->model, "wGT3X-BT");
  EXPECT_EQ(found->rate_hz, 30);
  EXPECT_EQ(found->accel_scale_lsb_per_g, 256);
  EXPECT_TRUE(found->accel_scale_known);
  EXPECT_EQ(found->constants, std::vector{tests::kStored});
  EXPECT_FALSE(found->constants_problem);
  EXPECT_FALSE(found->already_repaired);
  // 70 seconds of 30 samples; packed 135 bytes a second, wide 180.
  EXPECT_EQ(found->samples, 2100U);
  EXPECT_EQ(found->sample_records, 70U);
  EXPECT_EQ(found->duration_s, 70);
  EXPECT_EQ(found->log_bytes, made.log().size());
  EXPECT_EQ(found->log_bytes_wide, made.log().size() + 70 * (180 - 135));
  EXPECT_FALSE(found->beyond_12_bits);
  std::uint64_t clipped = 0;
  for (const gt3x::Counts& counts : made.stored()) {
    clipped += std::ranges::any_of(counts, [](int c) { return c == -2048 || c == 2047; }) ? 1 : 0;
  }
  EXPECT_EQ(found->clipped_samples, clipped);
  // The stored constants are 0.1 to 0.2 g off what the sensor is, so 1 g is not 1 g at rest.
  EXPECT_GE(found->magnitude.blocks, 6U);
  EXPECT_GT(found->magnitude.mean_mg, 50);
  EXPECT_GE(found->magnitude.worst_mg, found->magnitude.mean_mg);
}

TEST(Survey, NamesWhatIsMissing) {
  MemoryFiles files;
  EXPECT_FAILS(survey(files, "none"), ErrorCode::no_input);
  tests::MadeRecording made;
  ASSERT_OK(made.write(files, "empty.gt3x"));
  const auto empty = survey(files, "empty.gt3x");
  ASSERT_OK(empty);
  EXPECT_EQ(empty->samples, 0U);
  EXPECT_TRUE(empty->constants_problem);

  made = tests::six_sides();
  made.constants.negative_lsb[1] = made.constants.positive_lsb[1];
  ASSERT_OK(made.write(files, "equal.gt3x"));
  const auto equal = survey(files, "equal.gt3x");
  ASSERT_OK(equal);
  ASSERT_TRUE(equal->constants_problem) << "a division by zero in Eq. 1-3";
  EXPECT_EQ(equal->constants_problem->where, "equal.gt3x");

  made.rate_hz = 0;
  made.raw.clear();
  ASSERT_OK(made.write(files, "no-rate.gt3x", Bytes{}));
  EXPECT_FAILS(survey(files, "no-rate.gt3x"), ErrorCode::bad_data);
}

TEST(Survey, ThousandsOfSetsOfConstantsAreOneProblem) {
  tests::MadeRecording made = tests::six_sides();
  made.between = [set = made](std::size_t second) mutable {
    Bytes bytes;
    for (int i = 0; i < 100; ++i) {
      set.constants.zero_lsb = {static_cast<int>(second), i, 0};
      gt3x::append_record(bytes, gt3x::RecordType::parameters, 7, set.parameters());
    }
    return bytes;
  };
  MemoryFiles files;
  ASSERT_OK(made.write(files, "hostile.gt3x"));
  const auto found = survey(files, "hostile.gt3x");
  ASSERT_OK(found);
  ASSERT_TRUE(found->constants_problem);
  EXPECT_NE(found->constants_problem->what.find("sets of constants"), std::string::npos);
  EXPECT_LE(found->constants.size(), kMaxSetsOfConstants + 1);
}

TEST(Survey, TwoFirmwareVersionsAreBothKept) {
  tests::MadeRecording made = tests::six_sides();
  gt3x::ParameterValues values = gt3x::parse_parameters(made.parameters())->values;
  values[gt3x::kParameterFirmwareVersion] = *gt3x::encode_firmware("1.8.0");
  Bytes log;
  gt3x::append_record(log, gt3x::RecordType::parameters, 7, gt3x::encode_parameters(values));
  const Bytes rest = made.log();
  log.insert(log.end(), rest.begin(), rest.end());
  MemoryFiles files;
  ASSERT_OK(made.write(files, "two.gt3x", log));
  auto found = survey(files, "two.gt3x");
  ASSERT_OK(found);
  EXPECT_EQ(found->facts.firmware, "1.5.0");
  EXPECT_EQ(found->facts.other_firmware, "1.8.0");
  made.firmware = "1.8";  // the same, in other words
  ASSERT_OK(made.write(files, "one.gt3x", log));
  found = survey(files, "one.gt3x");
  ASSERT_OK(found);
  EXPECT_EQ(found->facts.other_firmware, "");
}

// For the first samples the last PARAMETERS before them hold; another date behind them that leads
// to another answer leaves none.
TEST(Survey, OfTwoDatesOfCalibrationTheOneInForceHoldsOrNone) {
  constexpr std::int64_t kLater = 1'400'000'000;  // 2014-05-13
  const auto found_with = [](std::int64_t before, std::int64_t at_start, std::int64_t behind) {
    tests::MadeRecording made = tests::six_sides();
    auto record_of = [made](std::int64_t date) mutable {
      made.calibrated = date;
      Bytes bytes;
      gt3x::append_record(bytes, gt3x::RecordType::parameters, 7, made.parameters());
      return bytes;
    };
    made.calibrated = at_start;
    made.between = [&](std::size_t second) { return second == 2 ? record_of(behind) : Bytes{}; };
    Bytes log = record_of(before);
    const Bytes rest = made.log();
    log.insert(log.end(), rest.begin(), rest.end());
    MemoryFiles files;
    EXPECT_OK(made.write(files, "dates.gt3x", log));
    const auto facts = facts_of(files, "dates.gt3x");
    EXPECT_OK(facts);
    EXPECT_EQ(facts->calibration_time, from_unix_seconds(at_start));
    auto found = survey(files, "dates.gt3x");
    EXPECT_OK(found);
    return *std::move(found);
  };
  const std::int64_t early = tests::MadeRecording().calibrated;
  EXPECT_EQ(triage(found_with(kLater, early, early).facts).verdict, Verdict::affected);
  EXPECT_EQ(triage(found_with(early, kLater, kLater).facts).verdict, Verdict::not_affected);
  EXPECT_EQ(triage(found_with(early, early, early + 86'400).facts).verdict, Verdict::affected);
  const Survey two = found_with(kLater, kLater, early);
  EXPECT_EQ(triage(two.facts).verdict, Verdict::cannot_tell);
  EXPECT_EQ(filter_of_constants(two.facts), std::nullopt);
  const std::string reason = triage(two.facts).reasons.back();
  EXPECT_NE(reason.find("two dates of calibration"), std::string::npos) << reason;
}

// A firmware that a later PARAMETERS record names counts where it leads to another answer, to turned axes or to another
// filter.
TEST(Survey, ALaterFirmwareThatLeadsToAnotherAnswerStandsBesideTheFirst) {
  const auto found_with = [](const std::string& first, const std::string& behind) {
    tests::MadeRecording made = tests::six_sides();
    made.firmware = first;
    made.between = [&](std::size_t second) {
      Bytes bytes;
      if (second == 20) {
        gt3x::ParameterValues values = gt3x::parse_parameters(made.parameters())->values;
        values[gt3x::kParameterFirmwareVersion] = *gt3x::encode_firmware(behind);
        gt3x::append_record(bytes, gt3x::RecordType::parameters, 7,
                            gt3x::encode_parameters(values));
      }
      return bytes;
    };
    MemoryFiles files;
    EXPECT_OK(made.write(files, "in.gt3x"));
    auto found = survey(files, "in.gt3x");
    EXPECT_OK(found);
    return *std::move(found);
  };
  EXPECT_EQ(triage(found_with("1.5.0", "1.5.0").facts).verdict, Verdict::affected);
  EXPECT_EQ(triage(found_with("1.5.0", "1.7.0").facts).verdict, Verdict::affected);
  for (const auto& [first, behind] : {std::pair("1.5.0", "1.8.0"), std::pair("1.5.0", "1.6.0"),
                                      std::pair("1.8.0", "1.5.0"), std::pair("1.6.0", "1.5.0")}) {
    const Survey two = found_with(first, behind);
    EXPECT_EQ(two.facts.other_firmware, behind);
    EXPECT_EQ(triage(two.facts).verdict, Verdict::cannot_tell) << first << ", then " << behind;
  }
  EXPECT_EQ(filter_in_force(found_with("1.5.0", "1.8.0").facts), std::nullopt);
}

// The table of Survey::constants.
TEST(Survey, ConstantsOfSamplesBeforeTheFirstCompleteRecord) {
  tests::MadeRecording made = tests::six_sides();
  const gt3x::ParameterValues whole = gt3x::parse_parameters(made.parameters())->values;
  const auto record_of = [](const gt3x::ParameterValues& values) {
    Bytes bytes;
    gt3x::append_record(bytes, gt3x::RecordType::parameters, 7, gt3x::encode_parameters(values));
    return bytes;
  };
  const std::size_t own = record_of(whole).size();
  // `first` in the place of the recording's own PARAMETERS, which come at `second`.
  const auto found_with = [&](const Bytes& first, std::size_t second) {
    made.between = [&](std::size_t at) { return at == second ? record_of(whole) : Bytes{}; };
    Bytes log = made.log();
    log.erase(log.begin(), log.begin() + static_cast<std::ptrdiff_t>(own));
    log.insert(log.begin(), first.begin(), first.end());
    MemoryFiles files;
    EXPECT_OK(made.write(files, "in.gt3x", log));
    auto found = survey(files, "in.gt3x");
    EXPECT_OK(found);
    return *std::move(found);
  };
  const Survey plain = found_with(record_of(whole), 20);
  EXPECT_TRUE(plain.notes.empty());
  gt3x::ParameterValues eight = whole;
  eight.erase({gt3x::kParameterUnitSpace, gt3x::kParameterZero});
  gt3x::ParameterValues other = eight;
  other[{gt3x::kParameterUnitSpace, gt3x::kParameterPositive}] = 400;
  for (const Bytes& first : {Bytes{}, record_of(eight)}) {
    const Survey found = found_with(first, 20);
    EXPECT_EQ(found.constants, std::vector{made.constants});
    EXPECT_FALSE(found.constants_problem);
    ASSERT_EQ(found.notes.size(), 1U);
    EXPECT_NE(found.notes[0].find("the first 600 samples stand before"), std::string::npos)
        << found.notes[0];
    ASSERT_EQ(found.blocks.size(), plain.blocks.size());
    for (std::size_t i = 0; i < plain.blocks.size(); ++i) {
      EXPECT_EQ(found.blocks[i].mean_lsb, plain.blocks[i].mean_lsb) << i;
    }
  }
  const Survey contradicted = found_with(record_of(other), 20);
  ASSERT_TRUE(contradicted.constants_problem);
  EXPECT_NE(contradicted.constants_problem->what.find("is not known"), std::string::npos);
  EXPECT_FALSE(found_with(record_of(other), 0).constants_problem) << "no samples of it";
}

TEST(Survey, AScaleThatCannotBeIsSaid) {
  MemoryFiles files;
  const tests::MadeRecording made = tests::six_sides();
  gt3x::ParameterValues values = gt3x::parse_parameters(made.parameters())->values;
  for (const double scale : {256.0, 0.0}) {
    for (const char* line : {"256.0", "256,0", "0", "NaN"}) {
      values[gt3x::kParameterAccelScale] = gt3x::encode_float(scale);
      Bytes log;
      gt3x::append_record(log, gt3x::RecordType::parameters, 7, gt3x::encode_parameters(values));
      const std::string path = fmt::format("{}-{}.gt3x", scale, line);
      auto writer = gt3x::RecordingWriter::create(files, path).value();
      ASSERT_OK(writer.add("log.bin", log));
      ASSERT_OK(writer.add("info.txt",
                           fmt::format("Serial Number: MOS2A1\r\nFirmware: 1.5.0\r\nSample Rate: "
                                       "30\r\nAcceleration Scale: {}\r\n",
                                       line)));
      ASSERT_OK(writer.commit());
      const auto found = survey(files, path);
      ASSERT_OK(found);
      EXPECT_EQ(found->accel_scale_lsb_per_g, 256) << path;
      const std::size_t wrong =
          (scale == 0 ? 1 : 0) + (std::string_view(line).starts_with("256") ? 0 : 1);
      EXPECT_EQ(found->notes.size(), wrong) << path;
    }
  }
}

TEST(Survey, KnowsTheMarkAndWideRecords) {
  MemoryFiles files;
  tests::MadeRecording made = tests::six_sides();
  made.activity2 = true;
  auto writer = gt3x::RecordingWriter::create(files, "marked.gt3x").value();
  ASSERT_OK(writer.add("log.bin", made.log()));
  gt3x::Info info;
  info.set("Serial Number", made.serial);
  info.set("Sample Rate", "30");
  ASSERT_OK(writer.add("info.txt", info.serialise()));
  ASSERT_OK(writer.add(kRepairMark, "{}"));
  ASSERT_OK(writer.commit());
  const auto found = survey(files, "marked.gt3x");
  ASSERT_OK(found);
  EXPECT_TRUE(found->already_repaired);
  EXPECT_TRUE(found->constants.empty()) << "its counts no longer come from its PARAMETERS";
  EXPECT_EQ(found->log_bytes_wide, found->log_bytes) << "wide already";
}

// PARAMETERS with another acceleration scale in the middle: each scale holds for what follows it.
TEST(Survey, FollowsTheAccelerationScaleInForce) {
  MemoryFiles files;
  const tests::MadeRecording made = tests::six_sides();
  ASSERT_OK(made.write(files, "one.gt3x"));
  ASSERT_OK(made.write(files, "two.gt3x", tests::log_of_two_scales(made)));
  const auto one = survey(files, "one.gt3x");
  const auto two = survey(files, "two.gt3x");
  ASSERT_OK(one);
  ASSERT_OK(two);
  EXPECT_EQ(two->samples, one->samples);
  EXPECT_EQ(two->magnitude.blocks, one->magnitude.blocks);
  EXPECT_NEAR(two->magnitude.mean_mg, one->magnitude.mean_mg, 2);
  EXPECT_EQ(two->constants.size(), 1U);
  ASSERT_EQ(two->notes.size(), 1U);
  EXPECT_NE(two->notes[0].find("from 256 to 512 LSB/g"), std::string::npos) << two->notes[0];
}

TEST(Survey, TheOldFormHasConstantsAndStillPeriods) {
  MemoryFiles files;
  tests::OldRecording made;
  made.raw = tests::many_sides().raw;
  ASSERT_OK(made.write(files, "old.gt3x"));
  const auto found = survey(files, "old.gt3x");
  ASSERT_OK(found);
  EXPECT_FALSE(found->constants_problem);
  EXPECT_EQ(found->samples, made.raw.size());
  EXPECT_EQ(found->accel_scale_lsb_per_g, 341);
  EXPECT_EQ(found->constants, std::vector{tests::kStored});
  EXPECT_EQ(found->facts.calibration_time, parse_iso8601("2010-10-21T11:23:47").value());
  EXPECT_GE(found->magnitude.blocks, 30U);
  EXPECT_GT(found->magnitude.mean_mg, 50) << "the constants do not fit";
  EXPECT_TRUE(found->plausibility.plausible());

  // A unit that charges stores zeros on all axes: no still periods.
  made.zeros = 3000;
  ASSERT_OK(made.write(files, "charged.gt3x"));
  const auto charged = survey(files, "charged.gt3x");
  ASSERT_OK(charged);
  EXPECT_EQ(charged->samples, made.raw.size() + 3000);
  EXPECT_EQ(charged->magnitude.blocks, found->magnitude.blocks);
}

TEST(Survey, OldConstantsThatCannotBeUsedAreAProblem) {
  MemoryFiles files;
  tests::OldRecording made;
  made.raw = tests::six_sides().raw;
  const auto problem_of = [&](const Bytes& eeprom) {
    EXPECT_OK(made.write(files, "old.gt3x", eeprom));
    const auto found = survey(files, "old.gt3x");
    EXPECT_OK(found);
    EXPECT_GE(found->magnitude.blocks, 6U) << "evidence all the same";
    const std::string text = found->constants_problem ? found->constants_problem->what : "";
    EXPECT_OK(files.remove("old.gt3x"));
    return text;
  };
  Bytes bad = made.eeprom();
  bad[300] ^= 1;
  EXPECT_NE(problem_of(bad).find("CRC"), std::string::npos);
  EXPECT_NE(problem_of(Bytes{}).find("no eeprom.bin"), std::string::npos);
  Bytes others = made.eeprom();
  others[12] = 'X';
  EXPECT_NE(problem_of(others).find("eeprom.bin is of"), std::string::npos);
}

// Oracle: a real unit (PROVENANCE: not affected), whose counts fit the constants in its memory.
TEST(Survey, ARealRecordingOfTheOldForm) {
  SIXPOINT_NEED_SHARED("data/nhanes/NEO1B34100019.gt3x");
  const auto found =
      survey(posix_env().files, tests::shared_file("data/nhanes/NEO1B34100019.gt3x"));
  ASSERT_OK(found);
  EXPECT_FALSE(found->constants_problem);
  EXPECT_EQ(found->samples, 10'467U);
  EXPECT_GT(found->magnitude.blocks, 0U);
  EXPECT_LT(found->magnitude.mean_mg, 64);
  EXPECT_EQ(found->facts.calibration_time, parse_iso8601("2010-10-21T11:23:47").value());
  EXPECT_EQ(triage(found->facts).verdict, Verdict::not_affected);
}

}  // namespace
}  // namespace sixpoint::repair
