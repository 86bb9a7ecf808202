#include "base/text/html.h"

#include <gtest/gtest.h>

namespace sixpoint {
namespace {

// Oracle: the HTML standard, "Serialising HTML fragments" and its named character references.
TEST(Html, FourCharactersBecomeEntities) {
  EXPECT_EQ(html_escaped("<"), "&lt;");
  EXPECT_EQ(html_escaped(">"), "&gt;");
  EXPECT_EQ(html_escaped("&"), "&amp;");
  EXPECT_EQ(html_escaped("\""), "&quot;");
  EXPECT_EQ(html_escaped("<a href=\"x\">R&D</a>"), "&lt;a href=&quot;x&quot;&gt;R&amp;D&lt;/a&gt;");
}

TEST(Html, WhatIsAnEntityAlreadyIsEscapedAgain) {
  EXPECT_EQ(html_escaped("&lt;"), "&amp;lt;") << "a reader shows what the text was";
  EXPECT_EQ(html_escaped(html_escaped("&")), "&amp;amp;");
}

TEST(Html, AllOtherBytesStay) {
  EXPECT_EQ(html_escaped(""), "");
  EXPECT_EQ(html_escaped("\u0141ukasz"), "\u0141ukasz");
  EXPECT_EQ(html_escaped(std::string_view("a\0b", 3)), std::string("a\0b", 3));
  for (int byte = 0; byte < 256; ++byte) {
    const std::string one(1, static_cast<char>(byte));
    if (one.find_first_of("<>&\"") == std::string::npos) {
      EXPECT_EQ(html_escaped(one), one) << byte;
    }
  }
}

}  // namespace
}  // namespace sixpoint
