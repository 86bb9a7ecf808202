#include "base/text/html.h"

#include <string>
#include <utility>

#include <gtest/gtest.h>

namespace sixpoint {
namespace {

// Oracle: the HTML standard, "Serialising HTML fragments" and its named character references.
TEST(Html, FourCharactersBecomeEntities) {
  const std::pair<const char*, const char*> cases[] = {
      {"<", "&lt;"},
      {">", "&gt;"},
      {"&", "&amp;"},
      {"\"", "&quot;"},
      {"<a href=\"x\">R&D</a>", "&lt;a href=&quot;x&quot;&gt;R&amp;D&lt;/a&gt;"}};
  for (const auto& [text, escaped] : cases) {
    EXPECT_EQ(html_escaped(text), escaped);
  }
}

TEST(Html, AHeadEscapesItsTitleAndEndsWithTheStyleOfThePage) {
  const std::string page = html_head("R&D <1>", "h1{color:red}") + std::string(kHtmlEnd);
  EXPECT_TRUE(
      page.starts_with("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
                       "<title>R&amp;D &lt;1&gt;</title><style>"));
  EXPECT_TRUE(
      page.ends_with("h1{color:red}</style></head><body>\n<h1>R&amp;D &lt;1&gt;</h1>\n"
                     "</body></html>\n"));
  EXPECT_EQ(page.find("http"), std::string::npos) << "no resource of another place";
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
