#include "base/text/counted.h"

#include <gtest/gtest.h>

namespace sixpoint {
namespace {

TEST(Counted, OneIsSingular) {
  EXPECT_EQ(counted(0, "file"), "0 files");
  EXPECT_EQ(counted(1, "file"), "1 file");
  EXPECT_EQ(counted(12, "file"), "12 files");
  EXPECT_EQ(counted(1, "entry"), "1 entry");
  EXPECT_EQ(counted(2, "entry"), "2 entries");
}

}  // namespace
}  // namespace sixpoint
