#include "base/bytes.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint {
namespace {

TEST(Bytes, TextAndHexGoBothWays) {
  const Bytes bytes = {0x00, 0x53, 0xff};
  EXPECT_EQ(to_hex(bytes), "0053ff");
  EXPECT_EQ(from_hex("0053ff"), bytes);
  EXPECT_EQ(from_hex(""), Bytes());
  EXPECT_EQ(as_text(bytes), std::string_view("\0S\xff", 3));
  EXPECT_TRUE(std::ranges::equal(as_bytes(std::string_view("\0S\xff", 3)), bytes));
  for (const char* bad : {"0", "0g", "0A", " 0", "0x"}) {
    EXPECT_FALSE(from_hex(bad)) << bad;
  }
}

TEST(Bytes, LinesLackTheirEnds) {
  using Lines = std::vector<std::string_view>;
  EXPECT_EQ(lines_of(""), Lines());
  EXPECT_EQ(lines_of("a\n\nb"), (Lines{"a", "", "b"}));
  EXPECT_EQ(lines_of("a\n"), (Lines{"a"}));
}

}  // namespace
}  // namespace sixpoint
