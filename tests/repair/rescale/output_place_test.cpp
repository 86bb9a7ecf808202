#include "repair/rescale/output_place.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

class OutputPlace : public testing::Test {
 protected:
  OutputPlace() {
    std::filesystem::create_directories(out_ + "/site");
    std::filesystem::create_directories(folder_ / "originals");
    std::filesystem::create_symlink(folder_ / "originals", out_ + "/leads-out");
    std::filesystem::create_symlink("site", out_ + "/stays");
    std::filesystem::create_symlink(out_, folder_ / "other-name");
  }
  Status check(const std::string& below) {
    return check_output_place(posix_env().files, out_, out_ + "/" + below);
  }

  tests::TemporaryFolder folder_;
  std::string out_ = folder_ / "out";
};

TEST_F(OutputPlace, InTheFolderOrBelowIt) {
  EXPECT_OK(check("a.gt3x"));
  EXPECT_OK(check("site/a.gt3x"));
  EXPECT_OK(check("stays/a.gt3x")) << "a link that stays in the folder";
  EXPECT_OK(check("new/deep/a.gt3x")) << "folders that are made for it";
  EXPECT_OK(check_output_place(posix_env().files, folder_ / "other-name",
                               folder_ / "other-name/site/a.gt3x"))
      << "the output folder itself may be a link";
  EXPECT_OK(check_output_place(posix_env().files, folder_ / "none", folder_ / "none/a/b.gt3x"));
}

TEST_F(OutputPlace, AFileHasOnePlaceByWhateverPath) {
  FileSystem& files = posix_env().files;
  const std::string real = std::filesystem::canonical(out_).string();
  const std::string place = real + "/site/a.gt3x";
  for (const std::string& name :
       {out_ + "/site/a.gt3x", out_ + "//site/./a.gt3x", out_ + "/leads-out/../out/site/a.gt3x",
        out_ + "/stays/a.gt3x", folder_ / "other-name/site/a.gt3x"}) {
    EXPECT_EQ(place_of(files, name), place) << name;
  }
  EXPECT_EQ(place_of(files, out_ + "/stays"), real + "/stays") << "a link is a file of its own";
  const std::string here = std::filesystem::current_path().string();
  EXPECT_EQ(place_of(files, "none.gt3x"), here + "/none.gt3x");
  EXPECT_EQ(place_of(files, "no-such-folder/none.gt3x"), here + "/no-such-folder/none.gt3x");
}

TEST_F(OutputPlace, ElsewhereIsRefused) {
  for (const char* below : {"leads-out/a.gt3x", "leads-out/new/a.gt3x", "site/../../a.gt3x"}) {
    EXPECT_FAILS(check(below), ErrorCode::cannot_create);
  }
}

}  // namespace
}  // namespace sixpoint::repair
