#include "repair/rescale/earlier_output.h"

#include <gtest/gtest.h>

#include "repair/jig_constants.h"

namespace sixpoint::repair {
namespace {

TEST(EarlierOutputs, ByTheirTable) {
  EXPECT_EQ(judge_earlier_output(std::nullopt, "a", "now"), EarlierOutput::none);
  EXPECT_EQ(judge_earlier_output(FoundOutput{"", "now"}, "a", "now"), EarlierOutput::foreign);
  EXPECT_EQ(judge_earlier_output(FoundOutput{"b", "now"}, "a", "now"), EarlierOutput::foreign);
  EXPECT_EQ(judge_earlier_output(FoundOutput{"", "now"}, "", "now"), EarlierOutput::foreign);
  EXPECT_EQ(judge_earlier_output(FoundOutput{"a", "now"}, "a", "now"), EarlierOutput::done);
  EXPECT_EQ(judge_earlier_output(FoundOutput{"a", "then"}, "a", "now"), EarlierOutput::outdated);
  EXPECT_EQ(judge_earlier_output(FoundOutput{"a", ""}, "a", "now"), EarlierOutput::outdated);
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
