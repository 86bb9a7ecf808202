#include "base/memory_env.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint {
namespace {

TEST(MemoryEnv, APowerCutForgetsWhatWasNotSynced) {
  MemoryFiles files;
  auto file = files.create("f").value();
  ASSERT_OK(file->write_at(0, Bytes{1, 2}));
  ASSERT_OK(file->sync());
  ASSERT_OK(files.sync_folder("."));
  ASSERT_OK(file->write_at(2, Bytes{3}));
  ASSERT_OK(files.create("g").value()->write_at(0, Bytes{4}));
  files.lose_power();
  EXPECT_EQ(read_file(files, "f").value(), (Bytes{1, 2}));
  EXPECT_FALSE(files.info("g"));
}

TEST(MemoryEnv, FailsFromTheGivenOperationOn) {
  MemoryFiles files;
  files.fail_after(1);
  EXPECT_OK(files.make_folders("a"));
  EXPECT_FAILS(files.create("a/f"), ErrorCode::io);
  EXPECT_FAILS(files.create("a/f"), ErrorCode::io);
  files.stop_failing();
  EXPECT_OK(files.create("a/f"));
}

TEST(MemoryEnv, TheClockMovesWhenItIsTold) {
  ManualClock clock(from_unix_seconds(100));
  clock.sleep(std::chrono::seconds(5));
  EXPECT_EQ(clock.now(), from_unix_seconds(105));
  EXPECT_EQ(clock.elapsed(), std::chrono::seconds(5));
  clock.set(from_unix_seconds(7));
  EXPECT_EQ(clock.now(), from_unix_seconds(7));
  EXPECT_EQ(clock.elapsed(), std::chrono::seconds(5)) << "a jump of the calendar alone";
}

}  // namespace
}  // namespace sixpoint
