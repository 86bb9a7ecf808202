#include "repair/rescale/gate.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/six_sides.h"

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;

// A row of the table: not written without force, written with it, and both numbers are said.
void expect_refused(const GateEvidence& evidence, GateRow row) {
  const GateAnswer answer = gate(evidence, false);
  EXPECT_EQ(answer.row, row);
  EXPECT_FALSE(answer.write);
  EXPECT_FALSE(answer.forced);
  EXPECT_THAT(answer.reason, HasSubstr(fmt::format("{:.1f} mg before", evidence.before_mg)));
  EXPECT_THAT(
      answer.reason,
      HasSubstr(fmt::format("{:.1f} mg after", evidence.written_mg.value_or(evidence.after_mg))));
  const GateAnswer forced = gate(evidence, true);
  EXPECT_TRUE(forced.write);
  EXPECT_TRUE(forced.forced);
  EXPECT_EQ(forced.reason, answer.reason);
}

TEST(Gate, WithoutStillPeriodsNothingCanBeChecked) {
  for (const bool force : {false, true}) {
    const GateAnswer answer = gate({0, 0, 0}, force);
    EXPECT_EQ(answer.row, GateRow::not_checked);
    EXPECT_TRUE(answer.write);
    EXPECT_FALSE(answer.forced);
    EXPECT_THAT(answer.reason, HasSubstr("could not be checked"));
  }
}

TEST(Gate, WhatAnotherFileOfTheUnitRefutesIsNotWritten) {
  GateEvidence evidence;
  evidence.refuted_by = "day1.gt3x";
  for (const bool force : {false, true}) {
    const GateAnswer answer = gate(evidence, force);
    EXPECT_EQ(answer.row, GateRow::refuted);
    EXPECT_EQ(answer.write, force);
    EXPECT_EQ(answer.forced, force);
    EXPECT_THAT(answer.reason, HasSubstr("day1.gt3x, of the same unit"));
    EXPECT_THAT(answer.reason, HasSubstr("use other constants"));
  }
  evidence = {9, 112, 0.8};
  evidence.refuted_by = "day1.gt3x";
  EXPECT_EQ(gate(evidence, false).row, GateRow::helps) << "its own still periods decide";
}

TEST(Gate, OnlyWhatSpeaksAgainstTheConstantsRefutesThem) {
  const GateEvidence affected = {9, 96, 1};
  const GateEvidence nearly_right = {9, 2, 1};
  for (const GateRow row : {GateRow::worse, GateRow::too_much_left}) {
    EXPECT_TRUE(refutes(row, affected));
    EXPECT_TRUE(refutes(row, nearly_right));
  }
  for (const GateRow row : {GateRow::refuted, GateRow::not_checked, GateRow::no_better,
                            GateRow::ambiguous, GateRow::weak, GateRow::helps}) {
    EXPECT_FALSE(refutes(row, affected));
    EXPECT_FALSE(refutes(row, nearly_right));
  }
  EXPECT_TRUE(refutes(GateRow::rounded_away, affected));
  EXPECT_FALSE(refutes(GateRow::rounded_away, nearly_right));
}

TEST(Gate, WhatGetsWorseIsNotWritten) {
  expect_refused({9, 12.25, 84.25}, GateRow::worse);
  expect_refused({9, 70.25, 70.75}, GateRow::worse);
  expect_refused({9, 0.255, 0.505}, GateRow::worse);
}

TEST(Gate, WhatWasRightAndGetsNoBetterIsNotWritten) {
  expect_refused({9, 12.25, 12.25}, GateRow::no_better);
  expect_refused({9, 12.25, 11.75}, GateRow::no_better);
  expect_refused({9, 64.00, 63.25}, GateRow::no_better);
  expect_refused({9, 1.96, 0.5, true, 1.96}, GateRow::rounded_away);
  expect_refused({9, 1.96, 0.5, true, 2.49}, GateRow::rounded_away);
  expect_refused({9, 70.25, 1.0, true, 70.25}, GateRow::rounded_away);
  EXPECT_EQ(gate({9, 1.96, 0.5, true, 1.95}, false).row, GateRow::helps);
  EXPECT_EQ(gate({9, 12.25, 11.25}, false).row, GateRow::helps) << "1 mg is enough";
}

TEST(Gate, WhatRightConstantsCannotLeaveIsNotWritten) {
  expect_refused({9, 140.25, 32.25}, GateRow::too_much_left);
  expect_refused({9, 60.25, 40.25}, GateRow::too_much_left);
  EXPECT_EQ(gate({9, 140, 32}, false).row, GateRow::helps);
  expect_refused({3, 140.25, 20.25}, GateRow::too_much_left);
  EXPECT_EQ(gate({3, 140, 20}, false).row, GateRow::weak);
}

TEST(Gate, InFewDirectionsARightInputIsLeftUnlessItsCountsAreTheUnitsOwn) {
  expect_refused({3, 31.75, 1.25, false}, GateRow::ambiguous);
  EXPECT_EQ(gate({3, 31.75, 1.25, true}, false).row, GateRow::weak);
  EXPECT_EQ(gate({3, 32.25, 1.25, false}, false).row, GateRow::weak);
  EXPECT_EQ(gate({4, 31.75, 1.25, false}, false).row, GateRow::helps);
}

TEST(Gate, AWeakCheckIsSaid) {
  const GateAnswer answer = gate({3, 112, 0.8, true}, false);
  EXPECT_EQ(answer.row, GateRow::weak);
  EXPECT_TRUE(answer.write);
  EXPECT_THAT(answer.reason, HasSubstr("3 of the at least 4 directions"));
}

TEST(Gate, WhatHelpsIsWrittenAndNeedsNoForce) {
  const GateAnswer answer = gate({9, 112, 0.8}, true);
  EXPECT_EQ(answer.row, GateRow::helps);
  EXPECT_TRUE(answer.write);
  EXPECT_FALSE(answer.forced);
  EXPECT_EQ(answer.reason, "");
}

// The oracle is the sensor that the recording was made with.
TEST(Gate, TheEvidenceIsOfTheFileAndOfWhatTheConstantsMakeOfIt) {
  MemoryEnv memory;
  ASSERT_OK(tests::six_sides().write(memory.files, "in.gt3x"));
  const Survey surveyed = survey(memory.files, "in.gt3x").value();
  const GateEvidence right = gate_evidence(surveyed, tests::kTrue);
  EXPECT_EQ(right.directions, 6);
  EXPECT_GT(right.before_mg, 100);
  EXPECT_LT(right.after_mg, 1);
  const GateEvidence same =
      gate_evidence(surveyed, calib::calibration_from(tests::kStored).value());
  EXPECT_NEAR(same.after_mg, same.before_mg, 0.5) << "half a count of rounding on six sides";
  EXPECT_TRUE(right.counts_are_the_units_own) << "positive - negative of z is 495, below 2 * 256";
}

// The table of why_not_lent(), a row each.
TEST(WhyNotLent, FollowsTheTable) {
  MemoryEnv memory;
  const auto why_of = [&](const tests::MadeRecording& made, const char* firmware = "") {
    Bytes log = made.log();
    if (*firmware != '\0') {
      gt3x::ParameterValues values = gt3x::parse_parameters(made.parameters())->values;
      values[gt3x::kParameterFirmwareVersion] = *gt3x::encode_firmware(firmware);
      Bytes first;
      gt3x::append_record(first, gt3x::RecordType::parameters, made.start - 1,
                          gt3x::encode_parameters(values));
      // In the place of its own, which is as long as the record of PARAMETERS without firmware.
      Bytes own;
      gt3x::append_record(own, gt3x::RecordType::parameters, made.start - 1, made.parameters());
      log.erase(log.begin(), log.begin() + static_cast<std::ptrdiff_t>(own.size()));
      log.insert(log.begin(), first.begin(), first.end());
    }
    EXPECT_OK(made.write(memory.files, "in.gt3x", log));
    return why_not_lent(survey(memory.files, "in.gt3x").value());
  };
  EXPECT_EQ(why_of(tests::six_sides()), "") << "affected, and 100 mg off";
  EXPECT_EQ(why_of(tests::six_sides(), "1.7.0"), "") << "the axes lie alike under both";
  EXPECT_THAT(why_of(tests::six_sides(), "1.6.0"),
              HasSubstr("1.5.0 and 1.6.0, which lay the axes"));
  EXPECT_THAT(why_of(tests::six_sides(), "1.8.0"),
              HasSubstr("1.5.0 and 1.8.0, which set the filter"));
  // Counts that are right by the stored constants, as other software leaves them.
  const auto corrected = [](std::size_t sides) {
    tests::MadeRecording made;
    made.constants = {{326, 287, 321}, {-201, -268, -199}, {61, 4, 61}};
    for (std::size_t side = 0; side < sides; ++side) {
      PerAxis<int> raw = made.constants.zero_lsb;
      raw[side / 2] = side % 2 == 0 ? made.constants.positive_lsb[side / 2]
                                    : made.constants.negative_lsb[side / 2];
      for (int i = 0; i < 900; ++i) {
        made.raw.push_back(raw);
      }
    }
    return made;
  };
  EXPECT_THAT(why_of(corrected(6)), HasSubstr("other software may have corrected it"));
  EXPECT_THAT(why_of(corrected(4)), HasSubstr("other software may have corrected it"));
  EXPECT_EQ(why_of(corrected(3)), "") << "in few directions much looks right by chance";
  tests::MadeRecording later = corrected(6);
  later.calibrated = 1'400'000'000;  // 2014-05-13
  EXPECT_EQ(why_of(later), "") << "not affected";
  tests::MadeRecording own = corrected(6);
  own.constants = tests::kStored;  // z has fewer than 512 counts between its sides
  own.raw.clear();
  for (std::size_t side = 0; side < 6; ++side) {
    PerAxis<int> raw = own.constants.zero_lsb;
    raw[side / 2] =
        side % 2 == 0 ? own.constants.positive_lsb[side / 2] : own.constants.negative_lsb[side / 2];
    Random random(side + 1);
    for (int i = 0; i < 900; ++i) {
      PerAxis<int> noisy = raw;
      for (int& count : noisy) {
        count += static_cast<int>(std::lround(random.normal()));
      }
      own.raw.push_back(noisy);
    }
  }
  EXPECT_EQ(why_of(own), "") << "only this unit's sensor makes such counts";
}

TEST(WhatMayHelp, FollowsTheTable) {
  EXPECT_THAT(what_may_help(false, 6), HasSubstr("--scan in place of"));
  for (const auto& [own_asked, sides] : {std::pair(false, 5U), {true, 6U}, {true, 5U}}) {
    EXPECT_THAT(what_may_help(own_asked, sides), HasSubstr("the unit on the jig")) << sides;
    EXPECT_THAT(what_may_help(own_asked, sides), testing::Not(HasSubstr("--scan"))) << sides;
  }
}

}  // namespace
}  // namespace sixpoint::repair
