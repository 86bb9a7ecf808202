#include "base/text/json_keys.h"

#include <gtest/gtest.h>

namespace sixpoint {
namespace {

TEST(JsonKeys, TheFirstThatStandsTwiceIsNamedByItsPath) {
  const std::vector<std::pair<std::string, std::string>> rows = {
      {R"({"a": 1, "a": 2})", "/a"},
      {R"({"a": [], "b": {"a": 1}, "a": 2})", "/a"},
      {R"({"l": [7, [], {}, {"x": 1, "y": {"x": 1}, "x": 1}]})", "/l/3/x"},
      {R"([{"a": 1}, {"": 1, "": 1}])", "/1/"},
      {R"({"a": 1, "\u0061": 2})", "/a"},  // the same key, written otherwise
  };
  for (const auto& [text, path] : rows) {
    EXPECT_EQ(doubled_json_key(text), path) << text;
  }
}

TEST(JsonKeys, OneKeyInTwoObjectsIsNone) {
  for (const char* text : {R"({"a": {"a": {"a": 1}}, "b": [{"a": 1}, {"a": 1}]})", "{}", "7", "",
                           R"({"a": 1, )", "no JSON"}) {
    EXPECT_EQ(doubled_json_key(text), std::nullopt) << text;
  }
}

TEST(JsonKeys, AMillionBracketsAreLeftToTheParser) {
  EXPECT_EQ(doubled_json_key(std::string(1'000'000, '[')), std::nullopt);
  std::string objects;
  for (int i = 0; i < 100'000; ++i) {
    objects += R"({"a":)";
  }
  EXPECT_EQ(doubled_json_key(objects), std::nullopt);
}

}  // namespace
}  // namespace sixpoint
