#include "gap/benchmark/benchmark_score.h"

#include <cmath>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::gap {
namespace {

LabelledEffect effect(const std::string& name, double size_over_bound) {
  return {name, std::string(family_of(name)), 1, size_over_bound};
}

Answer answer(const std::string& bundle, std::vector<std::pair<std::string, double>> effects,
              bool unknown, double probability) {
  Answer made;
  made.bundle = bundle;
  made.effects = std::move(effects);
  made.unknown = unknown;
  made.unknown_probability = probability;
  return made;
}

// Five bundles and four answers; every value below is worked out by hand.
//
//   bundle  truth (size over bound)                 answer               confidence     right
//   b1      nothing                                 nothing, tilt at .7  .9 * .3 = .27  yes
//   b2      tilt (4)                                tilt .9              .9             yes
//   b3      drift (10), tilt (1), second_order (3)  tilt .8, drift .95;  .8 * .4 = .32  no: drift
//                                                   unknown .6                          dominates
//   b4      outside (5), at X and Y of faces        drift .7; unknown    .7 * .5 = .35  no
//                                                   .5 at X, Z of faces
//   b5      outside (5)                             none                 0              no
class BenchmarkScore : public ::testing::Test {
 protected:
  BenchmarkScore() {
    labels_.trials = {
        {"b1", TrialKind::none, {}, {}},
        {"b2", TrialKind::single, {effect("tilt", 4)}, {}},
        {"b3",
         TrialKind::realistic,
         {effect("drift", 10), effect("tilt", 1), effect("second_order", 3)},
         {}},
        {"b4", TrialKind::outside, {effect("noises_off", 5)}, {{0, "faces"}, {1, "faces"}}},
        {"b5", TrialKind::outside, {effect("noises_off", 5)}, {{0, "faces"}}}};
    answers_ = {answer("b1", {}, false, 0.1), answer("b2", {{"tilt", 0.9}}, false, 0),
                answer("b3", {{"tilt", 0.8}, {"drift", 0.95}}, true, 0.6),
                answer("b4", {{"drift", 0.7}}, true, 0.5)};
    answers_[0].candidates = {{"tilt", 0.7}};
    answers_[3].where = {{0, "faces"}, {2, "faces"}};
  }
  double value(const char* name) const {
    const auto scores = score_answers(labels_, answers_, {.seed = 1, .draws = 50});
    return scores ? scores->at(name).value : -1;
  }
  Labels labels_;
  std::vector<Answer> answers_;
};

TEST_F(BenchmarkScore, NamingAndAbstaining) {
  // Known with unknown.probability 0.1 (right), 0 (right), 0.6 (wrong); outside 0.5 and 1.
  EXPECT_NEAR(value("open_auc"), 4.0 / 6, 1e-12);
  // The one realistic bundle is wrong.
  EXPECT_NEAR(value("open_auc_realistic"), 0, 1e-12);
  // Confidence 0.27 (right), 0.9 (right), 0.32; outside 0.35 and 0.
  EXPECT_NEAR(value("oscr"), 3.0 / 6, 1e-12);
  // Sorted: right, wrong, wrong, right, wrong; trapezoids of 0, .2, .4, .4, .6 in steps of 0.2.
  EXPECT_NEAR(value("augrc"), 0.2 * (0 + 0.1 + 0.3 + 0.4 + 0.5), 1e-12);
}

TEST_F(BenchmarkScore, Calibration) {
  // tilt 0.9 right, tilt 0.8 there, drift 0.7 not: in three bins, with labels apart or not.
  EXPECT_NEAR(value("top_label_calibration"), (0.1 + 0.2 + 0.7) / 3, 1e-12);
  EXPECT_NEAR(value("names_calibration"), (0.1 + 0.2 + 0.7) / 3, 1e-12);
  // 0.1, 0 and 0.6 of what is known, 0.5 of what is outside; the missing answer said nothing.
  EXPECT_NEAR(value("unknown_calibration"), (0.1 + 0 + 0.6 + 0.5) / 4, 1e-12);
}

TEST_F(BenchmarkScore, SetsOfNames) {
  EXPECT_NEAR(value("recall"), 2.0 / 3, 1e-12);  // of tilt in b2, drift and second_order in b3
  EXPECT_NEAR(value("precision"), 1, 1e-12);
  EXPECT_NEAR(value("f1"), 6.0 / 7, 1e-12);         // three hits; three names, four in truth
  EXPECT_NEAR(value("exact_set"), 1.0 / 2, 1e-12);  // b3 lacks one and says unknown
  EXPECT_NEAR(value("first_right"), 1, 1e-12);
  EXPECT_NEAR(value("dominant_first"), 0, 1e-12);
  EXPECT_NEAR(value("needless_unknown"), 1.0 / 2, 1e-12);
  EXPECT_NEAR(value("alarms"), 0, 1e-12);
  EXPECT_NEAR(value("outside_honest"), 1, 1e-12);  // one says unknown, one abstains
  EXPECT_NEAR(value("outside_confidently_wrong"), 0, 1e-12);
}

TEST_F(BenchmarkScore, PlacesAndPower) {
  EXPECT_NEAR(value("localisation_f1"), 0.5, 1e-12);  // one of two, and one beside
  EXPECT_TRUE(std::isnan(value("half_named_at")));    // three sizes are too few
  const auto scores = score_answers(labels_, answers_, {.seed = 1, .draws = 50});
  ASSERT_OK(scores);
  const auto step = [&](double size) -> const Share& {
    return std::ranges::find_if(scores->power,
                                [&](const PowerStep& s) { return size >= s.low && size < s.high; })
        ->named;
  };
  EXPECT_EQ(step(1).right, 1);
  EXPECT_EQ(step(3).of, 1);
  EXPECT_EQ(step(3).right, 0);
  EXPECT_EQ(step(4).right, 1);
  EXPECT_EQ(step(10).right, 1);
}

// One effect below twice the bound: silence is right, and so is its name; another name is not.
TEST_F(BenchmarkScore, SilenceIsRightWhereNothingMustBeNamed) {
  labels_.trials = {{"b1", TrialKind::single, {effect("tilt", 1.5)}, {}},
                    {"b2", TrialKind::outside, {effect("noises_off", 5)}, {}}};
  answers_ = {answer("b1", {}, false, 0), answer("b2", {}, true, 1)};
  EXPECT_EQ(value("open_auc"), 1);
  answers_[0].effects = {{"tilt", 0.95}};
  EXPECT_EQ(value("open_auc"), 1);
  answers_[0].effects = {{"drift", 0.95}};
  EXPECT_EQ(value("open_auc"), 0);
  labels_.trials[0].effects[0].size_over_bound = 2;
  answers_[0].effects.clear();
  EXPECT_EQ(value("open_auc"), 0);
}

TEST_F(BenchmarkScore, MissingAnswersAbstainAndAreCounted) {
  const auto scores = score_answers(labels_, answers_, {.seed = 1, .draws = 50});
  ASSERT_OK(scores);
  EXPECT_EQ(scores->bundles, 5U);
  EXPECT_EQ(scores->missing, 1U);
  EXPECT_EQ(scores->kinds.at("outside"), 2U);
  const auto none = score_answers(labels_, {}, {.seed = 1, .draws = 50});
  ASSERT_OK(none);
  EXPECT_EQ(none->missing, 5U);
  EXPECT_EQ(none->at("open_auc").value, 0);  // abstaining is never right on what is known
  EXPECT_EQ(none->at("recall").value, 0);
  EXPECT_EQ(none->at("needless_unknown").value, 1);
  EXPECT_EQ(none->at("augrc").value, 0.5);
}

TEST_F(BenchmarkScore, IntervalsHoldTheValueAndSayHowTheyCame) {
  const auto scores = score_answers(labels_, answers_);
  ASSERT_OK(scores);
  const Measure& recall = scores->at("recall");
  EXPECT_STREQ(recall.interval_by, "bootstrap");
  EXPECT_LE(recall.interval[0], recall.value);
  EXPECT_GE(recall.interval[1], recall.value);
  // Wilson for 1 of 2: 0.0945 to 0.9055 (z = 1.96).
  const Measure& exact = scores->at("exact_set");
  EXPECT_STREQ(exact.interval_by, "wilson");
  EXPECT_NEAR(exact.interval[0], 0.0945, 1e-4);
  EXPECT_NEAR(exact.interval[1], 0.9055, 1e-4);
}

TEST_F(BenchmarkScore, AnAnswerToNoBundleIsAnError) {
  answers_.push_back(answer("b6", {}, false, 0));
  EXPECT_FAILS(score_answers(labels_, answers_), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::gap
