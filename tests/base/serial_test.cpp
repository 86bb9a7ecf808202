#include "base/serial.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint {
namespace {

TEST(Serial, FollowsTheTable) {
  for (const char* good : {"MOS2A12345678", "a", "MOS2-1_x.7", "0123456789ABCDEF"}) {
    EXPECT_TRUE(is_serial(good)) << good;
  }
  for (const char* bad : {"", "MOS 2", "MOS2\n", "M\xc3\xb6S", "0123456789ABCDEF0", "\x7f"}) {
    EXPECT_FALSE(is_serial(bad)) << bad;
  }
  EXPECT_TRUE(is_name("")) << "firmware and model may be empty";
}

}  // namespace
}  // namespace sixpoint
