#include "repair/batch/repair_files.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/rescale/constants_finder.h"
#include "repair/six_sides.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

// Files that were found in an output folder in the tree, row by row.
class OutputsInTheTree : public testing::Test {
 protected:
  OutputsInTheTree() {
    std::filesystem::create_directories(out_ + "/sub");
    EXPECT_OK(tests::many_sides().write(files_, tree_ + "/a.gt3x"));
  }
  // "name", or "name: code" where it is refused.
  std::vector<std::string> inputs(const std::string& named, const std::string& folder) {
    auto found = named_files(files_, {named}, {".gt3x"}).files;
    leave_out_outputs(files_, found, folder);
    std::vector<std::string> names;
    for (const NamedFile& file : found) {
      names.push_back(file.relative +
                      (file.error ? ": " + std::string(to_string(file.error->code)) : ""));
    }
    return names;
  }

  FileSystem& files_ = posix_env().files;
  tests::TemporaryFolder folder_;
  std::string tree_ = folder_ / "tree";
  std::string out_ = tree_ + "/out";
};

TEST_F(OutputsInTheTree, WhatAnEarlierRunWroteIsLeftOut) {
  ConstantsFinder finder(posix_env(), {});
  const auto report = repair_file(posix_env(), tree_ + "/a.gt3x", out_ + "/sub/a.gt3x", finder, {});
  ASSERT_EQ(report.status, RepairStatus::repaired);
  EXPECT_THAT(inputs(tree_, out_), testing::ElementsAre("a.gt3x"));
}

TEST_F(OutputsInTheTree, LinksToInputsAreLeftOut) {
  std::filesystem::create_hard_link(tree_ + "/a.gt3x", out_ + "/hard.gt3x");
  std::filesystem::create_symlink(tree_ + "/a.gt3x", out_ + "/sub/symbolic.gt3x");
  EXPECT_THAT(inputs(tree_, out_), testing::ElementsAre("a.gt3x"));
}

TEST_F(OutputsInTheTree, AnyOtherRecordingIsRefusedByName) {
  std::filesystem::copy_file(tree_ + "/a.gt3x", out_ + "/sub/original.gt3x");
  EXPECT_THAT(inputs(tree_, out_),
              testing::ElementsAre("a.gt3x", "out/sub/original.gt3x: cannot_create"));
}

TEST_F(OutputsInTheTree, WhereTheFolderIsNotBelowTheTreeAllAreInputs) {
  std::filesystem::copy_file(tree_ + "/a.gt3x", out_ + "/sub/original.gt3x");
  EXPECT_THAT(inputs(out_ + "/sub", out_), testing::ElementsAre("original.gt3x"));
  EXPECT_THAT(inputs(tree_, tree_), testing::ElementsAre("a.gt3x", "out/sub/original.gt3x"));
  EXPECT_THAT(inputs(tree_, folder_ / "none"),
              testing::ElementsAre("a.gt3x", "out/sub/original.gt3x"));
}

TEST_F(OutputsInTheTree, ALinkInTheOutputFolderLeadsNoFileOut) {
  std::filesystem::create_directories(tree_ + "/b");
  std::filesystem::rename(tree_ + "/a.gt3x", tree_ + "/b/a.gt3x");
  const std::string folder = folder_ / "repaired";
  std::filesystem::create_directories(folder);
  std::filesystem::create_directories(folder_ / "elsewhere");
  std::filesystem::create_symlink(folder_ / "elsewhere", folder + "/b");
  UnitPool pool;
  ConstantsFinder finder(posix_env(), {});
  RepairFilesOptions options;
  options.folder = folder;
  const auto named = named_files(files_, {tree_}, {".gt3x"}).files;
  const auto reports = repair_files(posix_env(), named, options, finder, pool);
  ASSERT_EQ(reports.size(), 1U);
  EXPECT_EQ(reports[0].status, RepairStatus::failed);
  EXPECT_EQ(reports[0].error.value_or(Error{}).code, ErrorCode::cannot_create);
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "elsewhere"));
}

// A unit with a file that its still periods can check and one without still periods; another unit
// without any. Constants that are ten percent off in sensitivity, named for all of them.
class FilesWithoutStillPeriods : public testing::Test {
 protected:
  FilesWithoutStillPeriods() {
    EXPECT_OK(tests::many_sides().write(memory_.files, "in/day1.gt3x"));
    EXPECT_OK(moving().write(memory_.files, "in/a_moving.gt3x"));
    EXPECT_OK(moving().write(memory_.files, "in/z_moving.gt3x"));
    EXPECT_OK(memory_.files.make_folders("in"));
  }
  static tests::MadeRecording moving() {
    tests::MadeRecording made;
    Random random(8);
    for (int i = 0; i < 900; ++i) {
      made.raw.push_back(tests::sense({random.normal(), random.normal(), random.normal()}));
    }
    return made;
  }
  std::map<std::string, RepairReport> run(double sensitivity_factor, RepairFilesOptions how,
                                          bool backwards = false) {
    calib::ConstantsRecord record;
    record.serial = "MOS2A45130450";
    record.filter = calib::FilterConfiguration::current;
    record.calibration = tests::kTrue;
    for (double& value : record.calibration.sensitivity_g_per_lsb) {
      value *= sensitivity_factor;
    }
    ConstantsFinderOptions sources;
    sources.given = record;
    ConstantsFinder finder(memory_.env, sources);
    UnitPool pool;
    std::vector<NamedFile> files;
    for (const std::string name : {"a_moving.gt3x", "day1.gt3x", "z_moving.gt3x"}) {
      NamedFile file;
      file.path = "in/" + name;
      file.relative = name;
      files.push_back(file);
    }
    if (backwards) {
      std::ranges::reverse(files);
    }
    std::map<std::string, RepairReport> reports;
    for (RepairReport& report : repair_files(memory_.env, files, how, finder, pool)) {
      reports.emplace(report.input, std::move(report));
    }
    return reports;
  }
  MemoryEnv memory_;
};

TEST_F(FilesWithoutStillPeriods, AreNotRepairedWithConstantsThatAnotherFileOfTheUnitRefutes) {
  int runs = 0;
  for (const bool backwards : {false, true}) {
    for (const unsigned jobs : {1U, 3U}) {
      RepairFilesOptions how;
      how.folder = "out" + std::to_string(++runs);
      how.jobs = jobs;
      const auto reports = run(1.2, how, backwards);
      ASSERT_EQ(reports.size(), 3U);
      for (const auto& [input, report] : reports) {
        EXPECT_EQ(report.status, RepairStatus::not_repairable) << input;
        EXPECT_EQ(report.output, "") << input;
      }
      for (const char* moving : {"in/a_moving.gt3x", "in/z_moving.gt3x"}) {
        EXPECT_THAT(reports.at(moving).reasons,
                    testing::Contains(testing::HasSubstr("those of in/day1.gt3x")));
      }
    }
  }
}

TEST_F(FilesWithoutStillPeriods, AreRepairedWhereNoFileRefutesTheConstants) {
  RepairFilesOptions how;
  how.folder = "out";
  for (const auto& [input, report] : run(1, how)) {
    EXPECT_EQ(report.status, RepairStatus::repaired) << input;
  }
}

TEST_F(FilesWithoutStillPeriods, AreRepairedByForceAndTheMarkSaysSo) {
  RepairFilesOptions how;
  how.folder = "out";
  how.repair.force = true;
  for (const auto& [input, report] : run(1.2, how)) {
    EXPECT_EQ(report.status, RepairStatus::repaired) << input;
    EXPECT_TRUE(report.forced) << input;
  }
}

}  // namespace
}  // namespace sixpoint::repair
