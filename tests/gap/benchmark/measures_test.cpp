#include "gap/benchmark/measures.h"

#include <cmath>

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

// By hand: known answers right at 0.9, wrong at 0.8, right at 0.5; unknown at 0.5 and 0.6. The
// first is above both, the third half above one: (2 + 0.5) of 6 pairs.
TEST(Measures, RightAboveByHand) {
  const std::vector<Ranked> known = {{0.9, true}, {0.8, false}, {0.5, true}};
  EXPECT_NEAR(right_above(known, std::vector{0.5, 0.6}), 2.5 / 6, 1e-15);
  EXPECT_TRUE(std::isnan(right_above(known, {})));
  EXPECT_TRUE(std::isnan(right_above({}, std::vector{0.5})));
}

// The OSCR curve of those numbers, drawn by hand. From high thresholds to low: (false positives,
// correct) = (0, 1/3) above 0.6, (1/2, 1/3) at 0.6, and a tie at 0.5 to (1, 2/3).
TEST(Measures, RightAboveIsTheAreaUnderTheOscrCurve) {
  const double area = 0.5 * (1.0 / 3) + 0.5 * (1.0 / 3 + 2.0 / 3) / 2;
  const std::vector<Ranked> known = {{0.9, true}, {0.8, false}, {0.5, true}};
  EXPECT_NEAR(right_above(known, std::vector{0.5, 0.6}), area, 1e-15);
}

// Chance: OpenAUC of an answer without knowledge is half of the accuracy (all tied).
TEST(Measures, WithoutKnowledgeHalfOfTheAccuracy) {
  const std::vector<Ranked> known = {{0, true}, {0, true}, {0, true}, {0, false}};
  EXPECT_NEAR(right_above(known, std::vector{0.0, 0.0}), 0.75 / 2, 1e-15);
}

// Traub et al. 2024: AUGRC = (1 - AUROC) acc (1 - acc) + (1 - acc)^2 / 2. Four answers, right at
// 0.9 and 0.6, wrong at 0.7 and 0.2: AUROC 3 of 4, acc 1/2, so 1/4 * 1/4 + 1/8 = 0.1875.
TEST(Measures, RiskCoverageByItsClosedForm) {
  const std::vector<Ranked> answers = {{0.9, true}, {0.7, false}, {0.6, true}, {0.2, false}};
  EXPECT_NEAR(area_under_risk_coverage(answers), 0.1875, 1e-15);
  const std::vector<Ranked> wrong = {{0.9, false}, {0.3, false}};
  EXPECT_NEAR(area_under_risk_coverage(wrong), 0.5, 1e-15);
  const std::vector<Ranked> right = {{0.9, true}, {0.3, true}};
  EXPECT_EQ(area_under_risk_coverage(right), 0);
  // All tied: AUROC is 1/2.
  const std::vector<Ranked> tied = {{0.5, true}, {0.5, false}, {0.5, true}, {0.5, true}};
  EXPECT_NEAR(area_under_risk_coverage(tied), 0.5 * 0.75 * 0.25 + 0.0625 / 2, 1e-15);
  EXPECT_TRUE(std::isnan(area_under_risk_coverage({})));
}

// By hand: tilt twice at 0.8 with one right (|1.6 - 1| = 0.6), drift once at 0.85, right (0.15).
// With labels apart 0.75 / 3. Pooled: |2.45 - 2| / 3, since errors of opposite sign cancel.
TEST(Measures, TopLabelCalibrationByHand) {
  std::vector<Said> said = {{"tilt", 0.8, true}, {"tilt", 0.8, false}, {"drift", 0.85, true}};
  EXPECT_NEAR(calibration_error(said), 0.25, 1e-15);
  for (Said& one : said) {
    one.label = "";
  }
  EXPECT_NEAR(calibration_error(said), 0.15, 1e-15);
  EXPECT_TRUE(std::isnan(calibration_error({})));
}

// Points that are symmetrical about size 1.5 on the logarithmic scale: the fit has its half there.
TEST(Measures, HalfNamedWhereTheDataAreSymmetrical) {
  std::vector<Sized> effects;
  for (const double step : {1.2, 1.5, 2.0, 3.0}) {
    effects.push_back({1.5 * step, true});
    effects.push_back({1.5 / step, false});
  }
  effects.push_back({1.5 * 1.3, false});
  effects.push_back({1.5 / 1.3, true});
  // The penalty acts on the slope alone, and shifts the half by less than this.
  EXPECT_NEAR(half_named_at(effects), 1.5, 0.01);
  // Sizes that all answers name, far above, change nothing.
  effects.push_back({500, false});
  EXPECT_NEAR(half_named_at(effects), 1.5, 0.01);
  EXPECT_TRUE(std::isnan(half_named_at(std::vector<Sized>{{1, true}, {2, false}})));
}

TEST(Measures, HalfNamedOfCleanlyParted) {
  const std::vector<Sized> parted = {{0.25, false}, {0.5, false}, {2, true}, {4, true}};
  EXPECT_NEAR(half_named_at(parted), 1, 1e-6);
}

// The mean of 0 and 1 in equal numbers, 400 of them: its standard error is 0.025.
TEST(Measures, BootstrapIntervalOfAMean) {
  const auto mean = [](std::span<const std::size_t> drawn) {
    double sum = 0;
    for (const std::size_t i : drawn) {
      sum += static_cast<double>(i % 2);
    }
    return sum / static_cast<double>(drawn.size());
  };
  const auto [low, high] = bootstrap_interval(400, mean, 1);
  EXPECT_NEAR(low, 0.5 - 1.96 * 0.025, 0.006);
  EXPECT_NEAR(high, 0.5 + 1.96 * 0.025, 0.006);
  EXPECT_EQ(bootstrap_interval(400, mean, 1), bootstrap_interval(400, mean, 1));
  EXPECT_NE(bootstrap_interval(400, mean, 1), bootstrap_interval(400, mean, 2));
  EXPECT_TRUE(std::isnan(bootstrap_interval(0, mean, 1)[0]));
  EXPECT_TRUE(std::isnan(bootstrap_interval(
      9, [](std::span<const std::size_t>) { return NAN; }, 1)[0]));
}

}  // namespace
}  // namespace sixpoint::gap
