#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/env.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "text_of.h"

namespace sixpoint {
namespace {

TEST(PosixFiles, WritesReadsListsAndRefuses) {
  std::string folder = (std::filesystem::temp_directory_path() / "sixpoint-XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  FileSystem& files = posix_env().files;
  ASSERT_OK(files.make_folders(folder + "/x/y"));
  ASSERT_OK(write_file(files, folder + "/x/y/f", "12345"));
  EXPECT_EQ(text_of(files, folder + "/x/y/f"), "12345");
  EXPECT_EQ(files.info(folder + "/x/y/f")->size, 5U);
  EXPECT_EQ(files.list(folder + "/x/y").value(), std::vector<std::string>{"f"});
  EXPECT_FAILS(files.open(folder + "/none"), ErrorCode::no_input);
  EXPECT_FAILS(files.open(folder), ErrorCode::no_input);
  EXPECT_FAILS(files.create(folder + "/x/y/f"), ErrorCode::cannot_create);
  EXPECT_FAILS(read_file(files, folder + "/x/y/f", 4), ErrorCode::bad_data);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace sixpoint
