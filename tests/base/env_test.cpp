#include "base/env.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint {
namespace {

TEST(Env, TakesPathsApart) {
  EXPECT_EQ(folder_of("a/b/c.gt3x"), "a/b");
  EXPECT_EQ(folder_of("/c.gt3x"), "/");
  EXPECT_EQ(folder_of("c.gt3x"), ".");
  EXPECT_EQ(file_name_of("a/b/c.gt3x"), "c.gt3x");
  EXPECT_EQ(file_name_of("c.gt3x"), "c.gt3x");
}

TEST(Env, ReadsAWholeFileUpToItsLimit) {
  MemoryFiles files;
  ASSERT_OK(files.create("f").value()->write_at(0, Bytes{1, 2, 3}));
  EXPECT_EQ(read_file(files, "f", 3).value(), (Bytes{1, 2, 3}));
  EXPECT_FAILS(read_file(files, "f", 2), ErrorCode::bad_data);
  EXPECT_FAILS(read_file(files, "g"), ErrorCode::no_input);
}

}  // namespace
}  // namespace sixpoint
