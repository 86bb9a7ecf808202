#include "repair/units/unit_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/rescale/constants_finder.h"
#include "repair/units/unit_files.h"

namespace sixpoint::repair {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::half_sphere;

class Pool : public testing::Test {
 protected:
  Pool() {
    EXPECT_OK(half_sphere(2, 1, 1).write(memory_.files, "up.gt3x"));
    EXPECT_OK(half_sphere(2, -1, 2).write(memory_.files, "down.gt3x"));
    EXPECT_OK(memory_.files.make_folders("out"));
    options_.unit = &pool_;
  }
  RepairReport repair(ConstantsFinder& finder, const std::string& name) {
    return repair_file(memory_.env, name, "out/" + name, finder, {});
  }

  MemoryEnv memory_;
  UnitPool pool_;
  ConstantsFinderOptions options_;
};

TEST_F(Pool, FilesWaitAndAreRepairedByOneAnother) {
  ConstantsFinder finder(memory_.env, options_);
  for (const char* name : {"up.gt3x", "down.gt3x"}) {
    EXPECT_EQ(repair(finder, name).status, RepairStatus::not_repairable) << name;
  }
  EXPECT_THAT(pool_.waiting(), ElementsAre("down.gt3x", "up.gt3x"));
  EXPECT_FALSE(pool_.has_constants("up.gt3x")) << "not before close()";
  pool_.close(memory_.env.clock.now());
  for (const char* name : {"up.gt3x", "down.gt3x"}) {
    ASSERT_TRUE(pool_.has_constants(name));
    const RepairReport report = repair(finder, name);
    EXPECT_EQ(report.status, RepairStatus::repaired) << name;
    EXPECT_EQ(report.method, "unit_files");
    EXPECT_EQ(report.source->kind, "unit_files");
    EXPECT_LT(*report.still_error_after_mg, 5);
    EXPECT_THAT(report.reasons, Contains(HasSubstr("2 files of the unit")));
    EXPECT_THAT(report.reasons, testing::Not(Contains(HasSubstr("needed:")))) << "nothing is";
  }
}

TEST_F(Pool, AUnitOfOneFileHasNothingToAdd) {
  ConstantsFinder finder(memory_.env, options_);
  repair(finder, "up.gt3x");
  pool_.close(memory_.env.clock.now());
  EXPECT_FALSE(pool_.has_constants("up.gt3x"));
  EXPECT_EQ(pool_.why_none("up.gt3x"), "");
}

TEST_F(Pool, WithoutAPoolTheOtherFilesAreNotAsked) {
  options_.unit = nullptr;
  ConstantsFinder finder(memory_.env, options_);
  repair(finder, "up.gt3x");
  EXPECT_THAT(pool_.waiting(), testing::IsEmpty());
}

TEST_F(Pool, AnswersComeBackFromDiskAsTheyWere) {
  ConstantsFinder finder(memory_.env, options_);
  collect(memory_.files, "up.gt3x", finder);
  collect(memory_.files, "down.gt3x", finder);
  collect(memory_.files, "gone.gt3x", finder);
  pool_.close(memory_.env.clock.now());
  const auto again = UnitAnswers::parse(pool_.answers().to_json_lines());
  ASSERT_OK(again);
  EXPECT_EQ(again->to_json_lines(), pool_.answers().to_json_lines());
  KnownUnits known(*again);
  options_.unit = &known;
  ConstantsFinder second(memory_.env, options_);
  EXPECT_EQ(repair(second, "up.gt3x").status, RepairStatus::repaired);
  for (const char* damaged : {"{}", "x", R"({"serial":1})", R"({"serial":"A","row":"new"})"}) {
    EXPECT_FALSE(UnitAnswers::parse(damaged)) << damaged;
  }
}

TEST_F(Pool, AFileOfTheSameFilterHelpsAUnitThatLacksConstants) {
  auto again = half_sphere(2, -1, 3);
  again.calibrated = 1'402'000'000;  // after the change: not affected, the same filter
  ASSERT_OK(again.write(memory_.files, "again.gt3x"));
  ConstantsFinder finder(memory_.env, options_);
  EXPECT_EQ(collect(memory_.files, "up.gt3x", finder), "") << "it is asked itself";
  EXPECT_EQ(collect(memory_.files, "again.gt3x", finder), again.serial);
  EXPECT_THAT(pool_.units_that_lack(), ElementsAre(again.serial));
  collect_helper(memory_.files, "again.gt3x", pool_);
  pool_.close(memory_.env.clock.now());
  ASSERT_TRUE(pool_.has_constants("up.gt3x"));
  const RepairReport report = repair(finder, "up.gt3x");
  EXPECT_EQ(report.status, RepairStatus::repaired);
  EXPECT_LT(*report.still_error_after_mg, 5);
}

TEST_F(Pool, AUnitWithConstantsOfItsOwnLacksNone) {
  ASSERT_OK(tests::many_sides().write(memory_.files, "whole.gt3x"));
  ConstantsFinder finder(memory_.env, options_);
  collect(memory_.files, "up.gt3x", finder);
  EXPECT_EQ(pool_.units_that_lack().size(), 1U);
  collect(memory_.files, "whole.gt3x", finder);
  EXPECT_THAT(pool_.units_that_lack(), testing::IsEmpty());
}

TEST_F(Pool, FilesThatAreNotAffectedAreNotCollected) {
  auto other = half_sphere(2, -1, 3);
  other.firmware = "1.8.0";  // another filter
  ASSERT_OK(other.write(memory_.files, "other.gt3x"));
  ConstantsFinder finder(memory_.env, options_);
  collect(memory_.files, "up.gt3x", finder);
  EXPECT_EQ(collect(memory_.files, "other.gt3x", finder), "");
  collect_helper(memory_.files, "other.gt3x", pool_);
  pool_.close(memory_.env.clock.now());
  ASSERT_EQ(pool_.answers().all().size(), 1U);
  EXPECT_EQ(pool_.answers().all().begin()->second.row, UnitRow::alone);
}

}  // namespace
}  // namespace sixpoint::repair
