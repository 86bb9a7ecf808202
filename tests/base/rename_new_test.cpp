#include "base/rename_new.h"

#include <cerrno>

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "expect_result.h"
#include "temporary_folder.h"
#include "text_of.h"

namespace sixpoint {
namespace {

class RenameNew : public testing::TestWithParam<int (*)(const std::string&, const std::string&)> {
 protected:
  std::string path(const std::string& name) const { return folder_ / name; }
  tests::TemporaryFolder folder_;
  FileSystem& files_ = posix_env().files;
};

TEST_P(RenameNew, GivesAFileItsNewName) {
  ASSERT_OK(write_file(files_, path("from"), "text"));
  EXPECT_EQ(GetParam()(path("from"), path("to")), 0);
  EXPECT_EQ(text_of(files_, path("to")), "text");
  EXPECT_FALSE(files_.info(path("from")));
}

TEST_P(RenameNew, LeavesWhatHasTheName) {
  ASSERT_OK(write_file(files_, path("from"), "new"));
  ASSERT_OK(write_file(files_, path("to"), "old"));
  EXPECT_EQ(GetParam()(path("from"), path("to")), EEXIST);
  EXPECT_EQ(text_of(files_, path("to")), "old");
  EXPECT_EQ(text_of(files_, path("from")), "new");
}

TEST_P(RenameNew, SaysThatThereIsNothingToRename) {
  EXPECT_EQ(GetParam()(path("none"), path("to")), ENOENT);
}

INSTANTIATE_TEST_SUITE_P(BothWays, RenameNew, testing::Values(&rename_new, &rename_new_by_link));

}  // namespace
}  // namespace sixpoint
