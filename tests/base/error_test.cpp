#include "base/error.h"

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint {
namespace {

TEST(Error, BriefIsOneSafeLine) {
  const Error error{ErrorCode::bad_data, "no\nlog.bin", "a\x1b[2J.gt3x", "download it again"};
  EXPECT_EQ(error.brief(), "a\\x1b[2J.gt3x: no\\x0alog.bin; download it again");
  EXPECT_EQ(printable(std::string(10'000, 'a')).size(), 403U);
}

TEST(Error, KnowsItsExitCodes) {
  for (const int code : {64, 65, 66, 69, 70, 73, 74, 77, 78}) {
    EXPECT_TRUE(is_error_code(code)) << code;
  }
  for (const int code : {0, 1, 63, 67, 68, 71, 72, 75, 76, 79}) {
    EXPECT_FALSE(is_error_code(code)) << code;
  }
}

}  // namespace
}  // namespace sixpoint
