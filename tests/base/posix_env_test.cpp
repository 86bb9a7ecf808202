#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/env.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "open_files_limit.h"
#include "temporary_folder.h"
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

// What cannot be looked at now may well be there.
TEST(PosixFiles, OnlyANameThatLeadsToNothingIsNoInput) {
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  ASSERT_OK(write_file(files, folder / "f", "12345"));
  for (const std::string& nothing :
       {folder / "none", folder / "f/below", folder / std::string(300, 'x')}) {
    EXPECT_FAILS(files.open(nothing), ErrorCode::no_input);
    EXPECT_FAILS(files.info(nothing), ErrorCode::no_input);
  }
  std::filesystem::create_symlink("loop", folder / "loop");
  EXPECT_FAILS(files.open(folder / "loop"), ErrorCode::io);
  EXPECT_FAILS(files.info(folder / "loop"), ErrorCode::io);
  const tests::OpenFilesLimit limit(0);
  EXPECT_FAILS(files.open(folder / "f"), ErrorCode::io);
  EXPECT_FAILS(files.list(folder.path()), ErrorCode::io);
}

// Whoever has the lock of a name has that of the file that bears it, also where another one, which
// had the lock before, gave its file another name meanwhile. With the lock of the old file, this
// fails within some hundred rounds.
TEST(PosixFiles, ALockIsThatOfTheFileThatHasTheNameNow) {
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  const std::string name = folder / "locked";
  std::atomic<bool> done{false};
  std::thread renaming([&] {
    while (!done) {
      const auto held = files.lock(name);
      if (held && *held != nullptr) {
        static_cast<void>(files.rename(name, folder / "renamed"));
      }
    }
  });
  int held_twice = 0;
  for (int round = 0; round < 20'000; ++round) {
    const auto first = files.lock(name);
    if (first && *first != nullptr) {
      const auto second = files.lock(name);
      held_twice += second && *second != nullptr ? 1 : 0;
    }
  }
  done = true;
  renaming.join();
  EXPECT_EQ(held_twice, 0);
}

}  // namespace
}  // namespace sixpoint
