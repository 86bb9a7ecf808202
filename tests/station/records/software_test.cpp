#include "station/records/software.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "skip_unless.h"

namespace sixpoint::station {
namespace {

// Oracle: the version that CMakeLists.txt declares.
TEST(Software, TheNameHoldsTheProjectsVersion) {
  std::ifstream file(SIXPOINT_SOURCE "/CMakeLists.txt");
  std::stringstream text;
  text << file.rdbuf();
  constexpr std::string_view kBefore = "project(sixpoint VERSION ";
  const std::size_t at = text.str().find(kBefore);
  ASSERT_NE(at, std::string::npos);
  const std::size_t begin = at + kBefore.size();
  const std::string version = text.str().substr(begin, text.str().find(' ', begin) - begin);
  EXPECT_EQ(software_name(), "sixpoint " + version);
}

// Oracle: git itself knows the commit.
TEST(Software, TheBuildIsACommitOfThisCheckout) {
  std::string build = software_build();
  SIXPOINT_SKIP_UNLESS(std::filesystem::exists(SIXPOINT_SOURCE "/.git"),
                       "was not built from a git checkout");
  SIXPOINT_SKIP_UNLESS(std::system("git --version >/dev/null 2>&1") == 0, "git is missing");
  const std::size_t dirty = build.find("-dirty");
  if (dirty != std::string::npos) {
    EXPECT_EQ(dirty + 6, build.size());
    build.resize(dirty);
  }
  EXPECT_THAT(build, testing::MatchesRegex("[0-9a-f]+"));
  EXPECT_GE(build.size(), 12U);
  const std::string ask =
      fmt::format("git -C '{}' cat-file -e '{}^{{commit}}' 2>/dev/null", SIXPOINT_SOURCE, build);
  EXPECT_EQ(std::system(ask.c_str()), 0) << build;
}

TEST(Software, TheStoresTextHasTheBuildBehindTheName) {
  if (software_build().empty()) {
    EXPECT_EQ(software_and_build(), software_name());
  } else {
    EXPECT_EQ(software_and_build(), fmt::format("{} ({})", software_name(), software_build()));
  }
}

}  // namespace
}  // namespace sixpoint::station
