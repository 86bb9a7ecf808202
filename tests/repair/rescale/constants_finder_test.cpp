#include "repair/rescale/constants_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/jig_constants.h"
#include "repair/made_agdc.h"
#include "repair/six_sides.h"

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;

class Finder : public testing::Test {
 protected:
  Finder() {
    EXPECT_OK(tests::many_sides().write(memory_.files, "in.gt3x"));
    survey_ = survey(memory_.files, "in.gt3x").value();
    id_ = store_.add_constants(tests::jig_constants(), "").value();
  }
  ConstantsChoice choose(ConstantsFinderOptions options) {
    ConstantsFinder finder(memory_.env, std::move(options));
    return finder.choose("in.gt3x", survey_).value();
  }
  // No constants, and one reason that holds `text`.
  void expect_none(ConstantsFinderOptions options, const char* text) {
    const auto choice = choose(options);
    EXPECT_FALSE(choice.chosen);
    EXPECT_THAT(choice.reasons, testing::ElementsAre(HasSubstr(text)));
  }

  MemoryEnv memory_;
  db::Store store_ = db::Store::in_memory(memory_.env).value();
  db::Store empty_ = db::Store::in_memory(memory_.env).value();
  Survey survey_;
  std::string id_;
};

TEST_F(Finder, NamedConstantsComeBeforeTheStore) {
  ConstantsFinderOptions options;
  options.given = calib::parse_constants_record(tests::kConstants).value();
  options.store = &store_;
  EXPECT_EQ(choose(options).chosen->method, "constants");
}

TEST_F(Finder, TheStoreComesBeforeTheFile) {
  ConstantsFinderOptions options;
  options.store = &store_;
  const auto choice = choose(options);
  ASSERT_TRUE(choice.chosen);
  EXPECT_EQ(choice.chosen->method, "store");
  EXPECT_EQ(choice.chosen->constants_id, id_);
  EXPECT_EQ(choice.chosen->record.calibration.zero_lsb[1], 50.25);
  const auto snapshot = ConstantsSnapshot::of_store(store_).value();
  options.store = nullptr;
  options.snapshot = &snapshot;
  EXPECT_EQ(choose(options).chosen->constants_id, id_) << "a snapshot answers as the store does";
}

TEST_F(Finder, WhatIsNamedWinsOverTheStore) {
  ConstantsFinderOptions options;
  options.store = &store_;
  options.scan = true;
  EXPECT_EQ(choose(options).chosen->method, "scan");
  options.store_named = true;
  EXPECT_EQ(choose(options).chosen->method, "scan") << "also over one that is named";
  options.calibration_file = "in.gt3x";
  const ConstantsChoice by_file = choose(options);
  EXPECT_EQ(by_file.chosen->method, "calibration_file");
  EXPECT_EQ(by_file.chosen->record.made_from.sha256.size(), 64U);
}

TEST_F(Finder, ANamedSourceThatDoesNotFitStopsUnlessOrScan) {
  ConstantsFinderOptions options;
  options.given = calib::parse_constants_record(tests::kConstants).value();
  options.given->serial = "MOS2A45130999";
  options.store = &store_;
  expect_none(options, "MOS2A45130999");
  options.or_scan = true;
  const auto choice = choose(options);
  EXPECT_EQ(choice.chosen->method, "scan");
  EXPECT_THAT(choice.reasons, testing::ElementsAre(HasSubstr("MOS2A45130999")))
      << "why the named one was not used is said all the same";
}

TEST_F(Finder, ConstantsThatWereWithdrawnAreNamed) {
  ASSERT_OK(store_.withdraw_constants(id_, "A. Tester", "wrong jig"));
  ConstantsFinderOptions options;
  options.store = &store_;
  options.store_named = true;
  expect_none(options, "withdrawn: ");
  expect_none(options, "(wrong jig)");
  const auto taken = ConstantsSnapshot::of_store(store_).value();
  const auto snapshot = ConstantsSnapshot::parse(taken.to_json_lines()).value();
  options.store = nullptr;
  options.snapshot = &snapshot;
  expect_none(options, "(wrong jig)");
}

TEST_F(Finder, TheDefaultStoreGoesOnToTheFileWhereItHasNothing) {
  ConstantsFinderOptions options;
  options.store = &empty_;
  EXPECT_EQ(choose(options).chosen->method, "scan");
}

TEST_F(Finder, SaysWhyThereIsNothing) {
  ConstantsFinderOptions options;
  options.store = &empty_;
  options.store_named = true;
  expect_none(options, "MOS2A45130450");
}

TEST_F(Finder, ACalibrationFileMustBeOfThisUnit) {
  tests::MadeRecording other = tests::six_sides();
  other.serial = "MOS2A45130999";
  ASSERT_OK(other.write(memory_.files, "other.gt3x"));
  ConstantsFinderOptions options;
  options.calibration_file = "other.gt3x";
  expect_none(options, "MOS2A45130999");
}

TEST_F(Finder, ACalibrationFileThatIsMissingIsAReasonAndNoError) {
  ConstantsFinderOptions options;
  options.calibration_file = "none.gt3x";
  expect_none(options, "cannot be used");
}

// Before: by the offset and the matrix, which fit this unit; its diagonal alone leaves more than 5 mg.
TEST_F(Finder, TheResidualBeforeOfAnAgdcIsThatOfItsMatrix) {
  tests::MadeAgdc made;
  ASSERT_OK(made.write(memory_.files, "in.agdc"));
  const Survey raw = survey(memory_.files, "in.agdc").value();
  const auto solved = solve_survey("in.agdc", raw, {});
  ASSERT_OK(solved);
  EXPECT_LT(solved->residual_before_mg, 0.5);
  ASSERT_TRUE(solved->calibration);
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_NEAR(solved->calibration->zero_lsb[a], tests::MadeAgdc::kOffset[a], 2) << "raw counts";
  }
  made.calibrated = true;
  ASSERT_OK(made.write(memory_.files, "in.agdc"));
  const auto calibrated = solve_survey("in.agdc", survey(memory_.files, "in.agdc").value(), {});
  EXPECT_FAILS(calibrated, ErrorCode::bad_data);
  EXPECT_THAT(calibrated.error().what, HasSubstr("calibrated before they were written"));
}

// The command and Python print these notes and no others.
TEST_F(Finder, TheNotesSayWhatTheConstantsAreNotFor) {
  const auto notes_of = [&](const char* firmware) {
    Survey found = survey_;
    found.facts.firmware = firmware;
    return testing::PrintToString(solve_survey("in.gt3x", found, {}).value().notes);
  };
  EXPECT_THAT(notes_of("1.3.0"), HasSubstr("(firmware 1.3.0 chose it): its constants repair no"));
  EXPECT_THAT(notes_of("1.5.0"), testing::Not(HasSubstr("repair no")));
  Survey two = survey_;
  two.facts.other_firmware = "1.6.0";
  EXPECT_THAT(testing::PrintToString(solve_survey("in.gt3x", two, {}).value().notes),
              HasSubstr("1.5.0 and 1.6.0, which lay the axes"));
}

TEST_F(Finder, ARepairedRecordingIsNotSolved) {
  Survey repaired = survey_;
  repaired.already_repaired = true;
  EXPECT_FAILS(solve_survey("in.gt3x", repaired, {}), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::repair
