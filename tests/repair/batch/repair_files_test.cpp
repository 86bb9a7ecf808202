#include "repair/batch/repair_files.h"

#include <filesystem>

#include <gmock/gmock.h>

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

}  // namespace
}  // namespace sixpoint::repair
