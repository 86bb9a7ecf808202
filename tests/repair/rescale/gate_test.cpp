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

}  // namespace
}  // namespace sixpoint::repair
