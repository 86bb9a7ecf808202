// Trees that real disks hold: links in circles, folders that cannot be read, things that are no
// files.
#include "repair/triage/file_tree.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include "expect_result.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

using testing::ElementsAre;

class Tree : public testing::Test {
 protected:
  Tree() {
    for (const char* name : {"a/one.gt3x", "a/deep/two.GT3X", "b/three.gt3x", "b/four.txt"}) {
      std::filesystem::create_directories(std::filesystem::path(root_ + "/" + name).parent_path());
      std::ofstream(root_ + "/" + name) << "x";
    }
    std::filesystem::create_directories(outside_);
    std::ofstream(outside_ + "/far.gt3x") << "x";
  }
  std::vector<std::string> names(bool follow_out = true) {
    const auto tree = find_files(posix_env().files, root_, {{".gt3x"}, follow_out});
    EXPECT_OK(tree);
    std::vector<std::string> names;
    if (tree) {
      for (const FoundFile& file : tree->files) {
        names.push_back(file.relative);
      }
      not_followed_ = tree->not_followed.size();
      refused_ = tree->refused;
    }
    return names;
  }
  void link(const std::string& target, const std::string& name) {
    std::filesystem::create_symlink(target, root_ + "/" + name);
  }

  tests::TemporaryFolder folder_;
  std::string root_ = folder_ / "root";
  std::string outside_ = folder_ / "outside";
  std::size_t not_followed_ = 0;
  std::vector<RefusedPath> refused_;
};

TEST_F(Tree, ListsFolderByFolder) {
  std::ofstream(root_ + "/a.gt3x") << "x";
  std::ofstream(root_ + "/a/._one.gt3x") << "of macOS";
  EXPECT_THAT(names(), ElementsAre("a/deep/two.GT3X", "a/one.gt3x", "a.gt3x", "b/three.gt3x"));
}

// Two links per level that lead to one another: by name there would be 2^40 files.
TEST_F(Tree, LinksInCirclesEnd) {
  link("..", "a/up");
  link("../b", "a/left");
  link("../b", "a/right");
  link("../a", "b/left");
  link("../a", "b/right");
  link("self", "self");
  EXPECT_THAT(names(), ElementsAre("a/deep/two.GT3X", "a/one.gt3x", "b/three.gt3x"));
  EXPECT_THAT(names(false), ElementsAre("a/deep/two.GT3X", "a/one.gt3x", "b/three.gt3x"));
  EXPECT_EQ(not_followed_, 0U);
}

TEST_F(Tree, LinksOutOfTheTreeAreFollowedOnlyWhenAsked) {
  link(outside_, "a/out");
  link(outside_ + "/far.gt3x", "far.gt3x");
  link("a/one.gt3x", "alias.gt3x");
  EXPECT_THAT(names(true), ElementsAre("a/deep/two.GT3X", "a/one.gt3x", "a/out/far.gt3x",
                                       "alias.gt3x", "b/three.gt3x", "far.gt3x"));
  EXPECT_THAT(names(false),
              ElementsAre("a/deep/two.GT3X", "a/one.gt3x", "alias.gt3x", "b/three.gt3x"));
  EXPECT_EQ(not_followed_, 2U);
}

TEST_F(Tree, WhatCannotBeReadIsNamedAndTheRestFound) {
  link("nowhere.gt3x", "dangling.gt3x");
  EXPECT_EQ(names().size(), 3U);
  ASSERT_EQ(refused_.size(), 1U);
  EXPECT_EQ(refused_[0].error.code, ErrorCode::no_input);
  if (::geteuid() != 0) {  // root reads everything
    ::chmod((root_ + "/b").c_str(), 0);
    EXPECT_EQ(names().size(), 2U);
    EXPECT_EQ(refused_.size(), 2U);
    ::chmod((root_ + "/b").c_str(), 0755);
  }
}

TEST_F(Tree, AVeryDeepTreeIsWalked) {
  std::string deep = root_;
  for (int i = 0; i < 300; ++i) {
    deep += "/d";
  }
  std::filesystem::create_directories(deep);
  std::ofstream(deep + "/bottom.gt3x") << "x";
  EXPECT_EQ(names().size(), 4U);
}

TEST_F(Tree, ALockIsHeldOnce) {
  FileSystem& files = posix_env().files;
  auto first = files.lock(folder_ / "lock");
  ASSERT_OK(first);
  ASSERT_NE(*first, nullptr);
  auto second = files.lock(folder_ / "lock");
  ASSERT_OK(second);
  EXPECT_EQ(*second, nullptr);
  first->reset();
  second = files.lock(folder_ / "lock");
  ASSERT_OK(second);
  EXPECT_NE(*second, nullptr);
}

}  // namespace
}  // namespace sixpoint::repair
