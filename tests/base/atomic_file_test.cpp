#include "base/atomic_file.h"

#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "text_of.h"

namespace sixpoint {
namespace {

TEST(AtomicFile, ReplacesTheOldFileOnlyOnCommit) {
  MemoryEnv memory;
  ASSERT_OK(write_file(memory.files, "a/f", "old"));
  {
    auto out = AtomicFile::create(memory.files, "a/f");
    ASSERT_OK(out);
    ASSERT_OK(out->append("new and longer"));
    EXPECT_EQ(text_of(memory.files, "a/f"), "old");
  }
  EXPECT_EQ(text_of(memory.files, "a/f"), "old");
  EXPECT_EQ(memory.files.list("a")->size(), 1U) << "the temporary file must be gone";
  ASSERT_OK(write_file(memory.files, "a/f", "new"));
  EXPECT_EQ(text_of(memory.files, "a/f"), "new");
}

// The oracle is the promise itself: after a power cut at every single disk operation in turn, the
// file holds the old text or the new one, and the new one once commit() has returned.
TEST(AtomicFile, SurvivesAPowerCutAtEveryOperation) {
  for (std::size_t stop = 0;; ++stop) {
    MemoryEnv memory;
    ASSERT_OK(write_file(memory.files, "f", "old"));
    memory.files.fail_after(stop);
    const auto status = write_file(memory.files, "f", "new");
    memory.files.stop_failing();
    memory.files.lose_power();
    const std::string text = text_of(memory.files, "f");
    if (status) {
      EXPECT_EQ(text, "new");
      EXPECT_GE(stop, 5U) << "create, write, sync, rename, folder sync";
      break;
    }
    EXPECT_TRUE(text == "old" || text == "new") << text << " after operation " << stop;
  }
}

TEST(AtomicFile, StepsAsideForALeftoverTemporaryFile) {
  MemoryEnv memory;
  ASSERT_OK(memory.files.create("./.f.0.tmp"));
  ASSERT_OK(write_file(memory.files, "f", "text"));
  EXPECT_EQ(text_of(memory.files, "f"), "text");
}

}  // namespace
}  // namespace sixpoint
