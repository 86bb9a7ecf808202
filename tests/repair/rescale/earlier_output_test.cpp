#include "repair/rescale/earlier_output.h"

#include <gtest/gtest.h>

#include "repair/jig_constants.h"

namespace sixpoint::repair {
namespace {

TEST(EarlierOutputs, ByTheirTable) {
  const auto judge = [](const std::optional<FoundOutput>& found, const std::string& input) {
    return judge_earlier_output(found, std::nullopt, input, "now");
  };
  const auto says = [](const std::string& input, const std::string& recipe) {
    return FoundOutput{input, recipe, from_unix_seconds(5), "its own"};
  };
  EXPECT_EQ(judge(std::nullopt, "a"), EarlierOutput::none);
  EXPECT_EQ(judge(FoundOutput{}, "a"), EarlierOutput::foreign);
  EXPECT_EQ(judge(says("", "now"), "a"), EarlierOutput::foreign);
  EXPECT_EQ(judge(says("b", "now"), "a"), EarlierOutput::foreign);
  EXPECT_EQ(judge(says("", "now"), ""), EarlierOutput::foreign);
  EXPECT_EQ(judge(says("a", "now"), "a"), EarlierOutput::done);
  EXPECT_EQ(judge(says("a", "then"), "a"), EarlierOutput::outdated);
  EXPECT_EQ(judge(says("a", ""), "a"), EarlierOutput::outdated);
}

TEST(EarlierOutputs, WhatIsNotAsTheManifestKnowsItWasChanged) {
  const auto judge = [](const KnownOutput& known, const std::string& recipe,
                        std::optional<UtcTime> made_at = from_unix_seconds(5)) {
    return judge_earlier_output(FoundOutput{"a", recipe, made_at, "its own"}, known, "a", "now");
  };
  const auto manifest = [](const std::string& input, const std::string& sha256, int as_of_s = 5) {
    return KnownOutput{input, sha256, from_unix_seconds(as_of_s)};
  };
  EXPECT_EQ(judge(manifest("a", "its own"), "now"), EarlierOutput::done);
  EXPECT_EQ(judge(manifest("a", "its own"), "then"), EarlierOutput::outdated);
  EXPECT_EQ(judge(manifest("a", "another"), "now"), EarlierOutput::changed);
  EXPECT_EQ(judge(manifest("a", "another"), "then"), EarlierOutput::changed);
  EXPECT_EQ(judge(manifest("b", "another"), "now"), EarlierOutput::done) << "of another input";
  EXPECT_EQ(judge(manifest("a", "another", 4), "now"), EarlierOutput::done)
      << "made by a run that left no manifest";
  EXPECT_EQ(judge(manifest("a", "another", 6), "now"), EarlierOutput::changed);
  EXPECT_EQ(judge(manifest("a", "another"), "now", std::nullopt), EarlierOutput::changed)
      << "a mark without a time";
}

TEST(EarlierOutputs, ARecipeIsConstantsOptionsAndRules) {
  Recipe recipe;
  recipe.constants = calib::parse_constants_record(tests::kConstants).value();
  const std::string now = recipe_digest(recipe);
  EXPECT_EQ(now.size(), 64U);
  Recipe same = recipe;
  same.constants->made_at = from_unix_seconds(1);
  EXPECT_EQ(recipe_digest(same), now) << "when they were measured changes no sample";
  Recipe other = recipe;
  other.constants->calibration.zero_lsb[2] += 0.001;
  EXPECT_NE(recipe_digest(other), now);
  other = recipe;
  other.wide = true;
  EXPECT_NE(recipe_digest(other), now);
  other = recipe;
  other.store_only = true;
  EXPECT_NE(recipe_digest(other), now);
  other = recipe;
  other.rotation_undone = true;
  EXPECT_NE(recipe_digest(other), now);
  other = recipe;
  other.rules += 1;
  EXPECT_NE(recipe_digest(other), now);
  other = recipe;
  other.constants.reset();
  EXPECT_NE(recipe_digest(other), now);
}

}  // namespace
}  // namespace sixpoint::repair
