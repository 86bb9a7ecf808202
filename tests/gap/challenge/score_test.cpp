#include "gap/challenge/score.h"

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

Outcome outcome(TrialKind kind, std::vector<TrialEffect> truth,
                std::vector<std::pair<std::string, double>> named, bool unknown = false) {
  Outcome made;
  made.kind = kind;
  made.truth = std::move(truth);
  made.named = std::move(named);
  made.unknown = unknown;
  return made;
}

TEST(Score, CasesOfTheHeadersTable) {
  const std::vector<TrialEffect> tilt = {{"tilt", 1}};
  const auto single = [&](std::vector<std::pair<std::string, double>> named, bool unknown) {
    return outcome(TrialKind::single, tilt, std::move(named), unknown);
  };
  const Outcome unknown = single({{"drift", 0.99}}, true);
  EXPECT_TRUE(unknown.honest());
  EXPECT_FALSE(unknown.confidently_wrong());
  const Outcome family = single({{"misalignment", 0.99}}, false);  // geometry, as tilt is
  EXPECT_TRUE(family.honest());
  EXPECT_FALSE(family.first_right());
  EXPECT_FALSE(family.confidently_wrong());
  Outcome blind = single({}, false);
  EXPECT_FALSE(blind.honest());
  blind.not_observable = {"tilt"};
  EXPECT_TRUE(blind.honest());
  EXPECT_TRUE(single({{"drift", 0.91}}, false).confidently_wrong());
  EXPECT_FALSE(single({{"drift", 0.89}}, false).confidently_wrong());
  EXPECT_FALSE(single({{"drift", 0.89}}, false).honest());
}

// Wilson's interval for 8 of 10: 0.490 to 0.943 (Agresti and Coull 1998, by hand for z = 1.96).
TEST(Score, WilsonInterval) {
  const auto [low, high] = Share{8, 10}.interval();
  EXPECT_NEAR(low, 0.4902, 1e-4);
  EXPECT_NEAR(high, 0.9433, 1e-4);
  EXPECT_EQ(Share{}.interval()[1], 1);
}

TEST(Score, PairsByTheirF1) {
  // Two of two found, then one of two with a wrong one beside it: F1 = 2 x 3 / (4 + 4).
  const std::vector<TrialEffect> truth = {{"tilt", 1}, {"drift", 1}};
  const Scores scores = score({outcome(TrialKind::pair, truth, {{"tilt", 1}, {"drift", 1}}),
                               outcome(TrialKind::pair, truth, {{"tilt", 1}, {"jitter", 1}})},
                              false);
  EXPECT_NEAR(scores.f1(), 0.75, 1e-15);
  EXPECT_TRUE(std::isnan(Scores{}.f1())) << "no trial of two effects";
}

TEST(Score, CalibrationByHand) {
  Outcome one = outcome(TrialKind::single, {{"tilt", 1}}, {{"tilt", 0.8}});
  one.candidates = {{"tilt", 0.8}, {"drift", 0.1}};
  // |0.8 - 1| and |0.1 - 0| in two bins of one candidate each.
  EXPECT_NEAR(score({one}, false).calibration_error(), 0.15, 1e-15);
}

TEST(Score, StrippedTrialsCountAsWithheld) {
  const Outcome wrong = outcome(TrialKind::single, {{"tilt", 1}}, {{"drift", 0.99}});
  const Scores scores = score({wrong}, true);
  EXPECT_EQ(scores.first.of, 0);
  EXPECT_EQ(scores.withheld_wrong.right, 1);
  EXPECT_EQ(scores.withheld_honest.right, 0);
}

TEST(Score, AnswersOfAnotherFormAreFailures) {
  Outcome read;
  read_answer(nlohmann::json::parse(R"({"verdict": "explained", "effects": [{"name": "tilt",
    "probability": 0.9, "confounded_with": ["misalignment", 7]}, {"name": 3}],
    "not_observable": [{"name": "wrap"}], "unknown": {"present": true}})"),
              read);
  EXPECT_EQ(read.failure, "");
  ASSERT_EQ(read.named.size(), 1U);
  EXPECT_EQ(read.named[0].second, 0.9);
  EXPECT_TRUE(read.confounded.contains("misalignment"));
  EXPECT_TRUE(read.not_observable.contains("wrap"));
  EXPECT_TRUE(read.unknown);
  for (const char* text : {"[]", "{}", R"({"verdict": 7})"}) {
    Outcome none;
    read_answer(nlohmann::json::parse(text), none);
    EXPECT_NE(none.failure, "") << text;
  }
}

// By hand: of three effects two can be seen, one of them is named first; a second name is wrong.
TEST(Score, RealisticUnits) {
  Outcome outcome;
  outcome.kind = TrialKind::realistic;
  outcome.truth = {{"tilt", 4}, {"drift", 0.1}, {"third_order", 0.1}};
  outcome.named = {{"tilt", 0.99}, {"flicker", 0.95}};
  outcome.not_observable = {"third_order"};
  outcome.unknown = true;
  outcome.unknown_probability = 0.8;
  const Scores scores = score({outcome}, false);
  EXPECT_EQ(scores.dominant.right, 1);
  EXPECT_EQ(scores.recall.right, 1);
  EXPECT_EQ(scores.recall.of, 2);
  EXPECT_EQ(scores.precise.right, 1);
  EXPECT_EQ(scores.precise.of, 2);
  EXPECT_EQ(scores.exact_set.right, 0);
  EXPECT_EQ(scores.needless.right, 1);
  EXPECT_NEAR(scores.unknown_calibration_error(), 0.8, 1e-12);
}

}  // namespace
}  // namespace sixpoint::gap
