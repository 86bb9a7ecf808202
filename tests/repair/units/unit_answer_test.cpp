#include "repair/units/unit_answer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/rescale/constants_finder.h"
#include "repair/units/unit_files.h"

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using tests::half_sphere;
using tests::MadeRecording;

const UtcTime kNow = from_unix_seconds(1'700'000'000);

class Units : public testing::Test {
 protected:
  // What a survey of the recording finds; with constants where its still periods suffice.
  UnitFile file(const MadeRecording& made, const std::string& path) {
    EXPECT_OK(made.write(memory_.files, path));
    const Survey found = survey(memory_.files, path).value();
    UnitFile out{path,         found.facts.serial, calib::calibration_from(made.constants).value(),
                 found.blocks, std::nullopt,       false};
    const auto report = solve_survey(path, found, {}).value();
    if (report.usable()) {
      out.own = calib::record_of(report, kNow, {"", path, "", "file_scan"}).value();
    }
    return out;
  }
  // The largest error of a value of 1 g, over both directions of the axes, against the true sensor;
  // without the negative side of the axis `without`.
  static double error_mg(const calib::ConstantsRecord& record, std::size_t without = kAxes) {
    double worst_mg = 0;
    for (std::size_t a = 0; a < kAxes; ++a) {
      for (const double g : {-1.0, 1.0}) {
        if (a == without && g < 0) {
          continue;
        }
        const double raw_lsb = g / tests::kTrue.sensitivity_g_per_lsb[a] + tests::kTrue.zero_lsb[a];
        worst_mg = std::max(worst_mg, 1000 * std::abs(record.calibration.to_g(a, raw_lsb) - g));
      }
    }
    return worst_mg;
  }

  MemoryEnv memory_;
};

TEST_F(Units, OneFileIsAlone) {
  const auto answer = unit_answer({file(half_sphere(2, 1, 1), "a.gt3x")}, kNow);
  EXPECT_EQ(answer.row, UnitRow::alone);
  EXPECT_FALSE(answer.record);
  EXPECT_THAT(answer.missing_sides, testing::ElementsAre("-z"));
}

TEST_F(Units, HalvesOfTheSphereArePooled) {
  const auto up = file(half_sphere(2, 1, 1), "up.gt3x");
  const auto down = file(half_sphere(2, -1, 2), "down.gt3x");
  ASSERT_FALSE(up.own) << "none of the two suffices by itself";
  ASSERT_FALSE(down.own);
  const auto answer = unit_answer({up, down}, kNow);
  EXPECT_EQ(answer.row, UnitRow::pooled) << answer.why;
  ASSERT_TRUE(answer.record);
  EXPECT_EQ(answer.record->serial, up.serial);
  EXPECT_EQ(answer.record->filter, calib::FilterConfiguration::current);
  EXPECT_LT(error_mg(*answer.record), 5) << "against the constants that the sensor was made with";
  EXPECT_THAT(answer.missing_sides, IsEmpty());
  for (const double zero_mg : answer.record->uncertainty.zero_mg) {
    EXPECT_GT(zero_mg, 10 / std::sqrt(3.0) - 0.01) << "another file has another temperature";
  }
}

TEST_F(Units, TheOrderOfTheFilesAndCopiesMakeNoDifference) {
  const auto up = file(half_sphere(2, 1, 1), "up.gt3x");
  const auto down = file(half_sphere(2, -1, 2), "down.gt3x");
  auto copy = up;
  copy.path = "another name.gt3x";
  const auto answer = unit_answer({up, down}, kNow);
  const auto other = unit_answer({down, copy, up}, kNow);
  EXPECT_EQ(other.files, 2U);
  ASSERT_TRUE(answer.record && other.record);
  EXPECT_EQ(answer.record->calibration, other.record->calibration);
  EXPECT_EQ(unit_answer({up, copy}, kNow).row, UnitRow::alone) << "a copy is no other file";
}

TEST_F(Units, WhatNoFileHasIsMissing) {
  const auto answer = unit_answer(
      {file(half_sphere(2, 1, 1), "a.gt3x"), file(half_sphere(2, 1, 2), "b.gt3x")}, kNow);
  EXPECT_EQ(answer.row, UnitRow::missing);
  EXPECT_FALSE(answer.record);
  EXPECT_THAT(answer.missing_sides, testing::ElementsAre("-z"));
  EXPECT_THAT(answer.why, HasSubstr("-z"));
}

TEST_F(Units, NoStillPeriodIsMissing) {
  auto a = file(half_sphere(2, 1, 1), "a.gt3x");
  auto b = a;
  a.blocks.clear();
  b.blocks.clear();
  b.path = "b.gt3x";
  const auto answer = unit_answer({a, b}, kNow);
  EXPECT_EQ(answer.row, UnitRow::missing);
  EXPECT_EQ(answer.missing_sides.size(), 6U);
}

TEST_F(Units, VerifiedConstantsOfOneFileServeTheOthers) {
  const auto whole = file(tests::many_sides(), "whole.gt3x");
  const auto half = file(half_sphere(2, 1, 1), "half.gt3x");
  ASSERT_TRUE(whole.own);
  const auto answer = unit_answer({half, whole}, kNow);
  EXPECT_EQ(answer.row, UnitRow::sibling);
  ASSERT_TRUE(answer.record);
  EXPECT_EQ(answer.record->calibration, whole.own->calibration);
  EXPECT_THAT(answer.why, HasSubstr("whole.gt3x"));
}

TEST_F(Units, ACalibrationFileComesBeforeASurerOne) {
  auto first = file(tests::many_sides(5), "first.gt3x");
  auto second = file(tests::many_sides(6), "second.gt3x");
  ASSERT_TRUE(first.own && second.own);
  first.own->uncertainty.zero_mg = {2, 2, 2};
  second.own->uncertainty.zero_mg = {1, 1, 1};
  EXPECT_EQ(unit_answer({first, second}, kNow).record->calibration, second.own->calibration);
  first.is_calibration_file = true;
  EXPECT_EQ(unit_answer({first, second}, kNow).record->calibration, first.own->calibration);
}

TEST_F(Units, OwnConstantsThatDisagreeAreAContradiction) {
  auto first = file(tests::many_sides(5), "first.gt3x");
  auto second = first;
  second.path = "second.gt3x";
  second.blocks = file(tests::many_sides(6), "second.gt3x").blocks;
  second.own->calibration.zero_lsb[1] += 25;  // 100 mg
  const auto answer = unit_answer({first, second}, kNow);
  EXPECT_EQ(answer.row, UnitRow::contradiction);
  EXPECT_FALSE(answer.record);
  EXPECT_THAT(answer.why, testing::AllOf(HasSubstr("first.gt3x"), HasSubstr("second.gt3x")));
}

TEST_F(Units, FilesOfTwoUnitsUnderOneSerialNumberAreNotPooled) {
  for (const double shift_mg : {60.0, 120.0, -100.0}) {
    const auto up = file(half_sphere(2, 1, 1), "up.gt3x");
    const auto down = file(half_sphere(2, -1, 2, 15, {shift_mg, -shift_mg, shift_mg}), "down.gt3x");
    const auto answer = unit_answer({up, down}, kNow);
    EXPECT_EQ(answer.row, UnitRow::contradiction) << shift_mg << " " << answer.why;
    EXPECT_FALSE(answer.record);
  }
}

TEST_F(Units, OneFileBeyondTheToleranceRefusesThePool) {
  // Enough good files that the constants of all together verify by themselves.
  std::vector<UnitFile> files;
  for (std::uint64_t i = 0; i < 6; ++i) {
    files.push_back(
        file(half_sphere(2, i % 2 == 0 ? 1 : -1, 10 + i), "good" + std::to_string(i) + ".gt3x"));
  }
  ASSERT_EQ(unit_answer(files, kNow).row, UnitRow::pooled);
  files.push_back(file(half_sphere(0, 1, 30, 2, {40, 40, 40}), "strange.gt3x"));
  const auto answer = unit_answer(files, kNow);
  EXPECT_EQ(answer.row, UnitRow::contradiction) << answer.why;
  EXPECT_THAT(answer.why, testing::AllOf(HasSubstr("strange.gt3x"), HasSubstr("limit 16 mg")));
}

// Another unit's file under this serial number, with zeros elsewhere as real units differ. Where
// two files share no direction nothing can tell that they contradict each other; what is pooled
// then must still be right within the gate's limit (32 mg) on the sides that the file itself took.
TEST_F(Units, AnotherUnitsFileIsHardlyEverPooled) {
  Random random(5);
  int pooled = 0;
  constexpr int kTrials = 30;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto seed = static_cast<std::uint64_t>(trial) * 10 + 1000;
    PerAxis<double> shift_mg{};
    for (double& shift : shift_mg) {
      shift = 40 * random.normal();
    }
    const auto axis = static_cast<std::size_t>(trial % 3);
    const auto answer = unit_answer({file(half_sphere(axis, 1, seed, 10), "a.gt3x"),
                                     file(half_sphere(axis, -1, seed + 1, 10, shift_mg), "b.gt3x")},
                                    kNow);
    if (answer.record) {
      ++pooled;
      EXPECT_LT(error_mg(*answer.record, axis), 32) << trial;
    }
  }
  EXPECT_LE(pooled, kTrials / 5);
}

// The unit came back and was calibrated again: its files after that are right, by other constants.
MadeRecording calibrated_again(MadeRecording made) {
  made.calibrated = 1'402'000'000;  // 2014-06-05
  made.constants = {{310, 300, 300}, {-205, -220, -225}, {55, 40, 35}};
  return made;
}

TEST_F(Units, FilesOfTheSameFilterThatAreNotAffectedHelp) {
  const auto up = file(half_sphere(2, 1, 1), "up.gt3x");
  auto down = file(calibrated_again(half_sphere(2, -1, 2)), "down.gt3x");
  down.only_helps = true;
  ASSERT_FALSE(up.own || down.own);
  const auto answer = unit_answer({down, up}, kNow);
  EXPECT_EQ(answer.row, UnitRow::pooled) << answer.why;
  ASSERT_TRUE(answer.record);
  EXPECT_LT(error_mg(*answer.record), 5) << "against the constants that the sensor was made with";
}

TEST_F(Units, FilesThatOnlyHelpTakeNothingAway) {
  const auto alone = file(half_sphere(2, 1, 1), "a.gt3x");
  const auto other = file(half_sphere(2, 1, 4), "b.gt3x");
  const auto down = file(half_sphere(2, -1, 2), "down.gt3x");
  const auto whole = file(tests::many_sides(), "whole.gt3x");
  // A sensor that was replaced when the unit came back.
  auto strange = file(calibrated_again(half_sphere(2, -1, 3, 15, {60, -60, 60})), "new.gt3x");
  strange.only_helps = true;
  for (const std::vector<UnitFile>& affected :
       {std::vector<UnitFile>{alone}, {alone, other}, {alone, down}, {alone, whole}, {whole}}) {
    auto all = affected;
    all.push_back(strange);
    const auto without = unit_answer(affected, kNow);
    const auto with = unit_answer(all, kNow);
    EXPECT_EQ(with.row, without.row) << without.why;
    EXPECT_EQ(with.why, without.why);
    EXPECT_EQ(with.files, without.files);
    ASSERT_EQ(with.record.has_value(), without.record.has_value());
    if (with.record) {
      EXPECT_EQ(with.record->calibration, without.record->calibration);
    }
  }
  EXPECT_EQ(unit_answer({strange}, kNow).row, UnitRow::alone) << "no file lacks anything";
}

TEST(MayHelp, FollowsTheTable) {
  const UtcTime early = from_unix_seconds(1'384'266'733);
  const UtcTime late = from_unix_seconds(1'402'000'000);
  EXPECT_TRUE(may_help({"MOS2A45130450", "1.5.0", late})) << "not affected, current";
  EXPECT_TRUE(may_help({"MOS2A45130450", "1.8.0", late}));
  EXPECT_FALSE(may_help({"MOS2A45130450", "1.8.0", early})) << "not affected, legacy";
  EXPECT_FALSE(may_help({"MOS2A45130450", "1.2.0", early}));
  EXPECT_FALSE(may_help({"MOS2A45130450", "1.8.0", std::nullopt})) << "not said";
  EXPECT_FALSE(may_help({"NEO1A45130450", "1.5.0", late})) << "no such question";
  EXPECT_FALSE(may_help({"MOS2A45130450", "1.5.0", early})) << "affected";
}

TEST_F(Units, SeveralSerialNumbersAreAContradiction) {
  const auto up = file(half_sphere(2, 1, 1), "up.gt3x");
  auto down = file(half_sphere(2, -1, 2), "down.gt3x");
  down.serial = "MOS2A45139999";
  EXPECT_EQ(unit_answer({up, down}, kNow).row, UnitRow::contradiction);
}

// Other temperatures: files whose zeros stand apart by up to 10 mg on each axis, which is what the
// tolerance is for. Oracle: the constants that the sensor was made with.
TEST_F(Units, OtherTemperaturesStayWithinTheStatedUncertainty) {
  Random random(77);
  int pooled = 0;
  int within = 0;
  constexpr int kTrials = 12;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<UnitFile> files;
    for (std::uint64_t i = 0; i < 4; ++i) {
      PerAxis<double> shift_mg{};
      for (double& shift : shift_mg) {
        shift = random.uniform(-5, 5);
      }
      files.push_back(
          file(half_sphere(i / 2, i % 2 == 0 ? 1 : -1,
                           100 + static_cast<std::uint64_t>(trial) * 10 + i, 12, shift_mg),
               "f" + std::to_string(i) + ".gt3x"));
      files.back().own.reset();
    }
    const auto answer = unit_answer(files, kNow);
    if (answer.row != UnitRow::pooled) {
      continue;
    }
    ++pooled;
    within += error_mg(*answer.record) < 2 * 5.8 + 2 ? 1 : 0;
  }
  EXPECT_GE(pooled, kTrials * 3 / 4);
  EXPECT_EQ(within, pooled);
}

}  // namespace
}  // namespace sixpoint::repair
