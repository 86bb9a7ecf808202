#include "base/text/json_text.h"

#include <gtest/gtest.h>

namespace sixpoint {
namespace {

std::string brackets(std::size_t depth) {
  return std::string(depth, '[') + std::string(depth, ']');
}

TEST(JsonText, IsParsedToAHundredLevels) {
  EXPECT_EQ(parse_json(R"({"b": [1], "a": {}})").dump(), R"({"b":[1],"a":{}})") << "in its order";
  EXPECT_EQ(parse_json<nlohmann::json>("[7]")[0], 7);
  EXPECT_TRUE(parse_json("").is_discarded());
  EXPECT_TRUE(parse_json("[").is_discarded());
  EXPECT_FALSE(parse_json(brackets(100)).is_discarded());
  EXPECT_TRUE(parse_json(brackets(101)).is_discarded());
  EXPECT_TRUE(parse_json(brackets(1'000'000)).is_discarded());
  std::string objects;
  for (int i = 0; i < 200; ++i) {
    objects += R"({"a":)";
  }
  EXPECT_TRUE(nests_too_deep(objects));
}

TEST(JsonText, ThePlaceWhereItCeasesToBeJsonIsSaid) {
  EXPECT_EQ(why_no_json(R"({"a": [1, 2]})"), "");
  EXPECT_EQ(why_no_json("{\"a\": 1,\n \"b\": 1e400}"), "line 2 at '1e400'");
  EXPECT_EQ(why_no_json("{\"a\":\n\n NaN}"), "line 3 at 'N'");
  EXPECT_EQ(why_no_json("[1,\n2 3]"), "line 2 at '3'");
  EXPECT_EQ(why_no_json("[1,]"), "line 1 at ']'");
  EXPECT_EQ(why_no_json("word"), "line 1 at 'w'");
  EXPECT_EQ(why_no_json("[1"), "it ends too early");
  EXPECT_EQ(why_no_json(""), "it ends too early");
  EXPECT_EQ(why_no_json(brackets(101)), "it nests deeper than 100 objects and lists");
}

TEST(JsonText, BracketsInStringsAreNoLevels) {
  const std::string text = R"(["\"\\)" + std::string(500, '[') + R"(\"", "{"])";
  const auto json = parse_json(text);
  ASSERT_TRUE(json.is_array()) << text;
  EXPECT_EQ(json[0], "\"\\" + std::string(500, '[') + "\"");
  EXPECT_FALSE(parse_json("[" + brackets(99) + "," + brackets(99) + "]").is_discarded());
}

}  // namespace
}  // namespace sixpoint
