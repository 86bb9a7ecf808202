#include <gtest/gtest.h>

#include "gap/explain/made_blocks.h"
#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

TEST(MeasureGap, EffectsOutsideTheMeansAddTheirSquare) {
  const auto blocks = tests::made_dwells({}, 3);
  const Explanation explanation(blocks, {});
  Findings found;
  const GapSize plain = measure_gap({}, explanation, found);
  EXPECT_EQ(plain.closed_fraction, 0);
  EXPECT_NEAR(plain.after_interval_mg[1] - plain.after_mg, 1.96 * plain.after_mg / 6, 1e-9)
      << "54 rows are 18 means: 1 / sqrt(36)";
  found.outside_means = {{"wrap", 4}, {"wrap", 5}};
  const Bundle bundle;
  const DiagnoseOptions options;
  found.add({bundle, options}, {.name = "wrap", .nats = 9});
  const GapSize more = measure_gap({}, explanation, found);
  EXPECT_NEAR(more.before_mg, std::hypot(plain.before_mg, 3), 1e-12);
  EXPECT_GT(more.closed_fraction, 0.98) << "the effect explains all of it";
  // gap.after counts named effects only.
  found.outside_means.push_back({"dropped_samples", 16});
  const GapSize part = measure_gap({}, explanation, found);
  EXPECT_NEAR(part.before_mg, std::hypot(plain.before_mg, 5), 1e-12);
  EXPECT_NEAR(part.after_mg, std::hypot(more.after_mg, 4), 1e-12) << "nobody named what is lost";
  EXPECT_NEAR(part.after_sigma, std::hypot(more.after_sigma, 4 / plain.floor_mg), 1e-9);
  EXPECT_NEAR(part.closed_fraction, 9.0 / 25, 0.01);
  found.outside_means.pop_back();
  found.effects.clear();
  found.alarm(10, "somewhere");
  EXPECT_EQ(measure_gap({}, explanation, found).after_mg, more.before_mg) << "nothing is named";
}

// Of two lines one has no name: its part of the spectrum stays.
TEST(MeasureGap, ALineWithoutANameStaysInTheSpectrum) {
  const auto blocks = tests::made_dwells({}, 3);
  const Explanation explanation(blocks, {});
  Records records;
  records.lines.list.resize(2);
  records.lines.list[0] = {.gain_nats = 60, .in_lab = true, .decidable = true};
  records.lines.list[1] = {.gain_nats = 60, .in_lab = false, .decidable = true};
  const auto spectrum_with = [&](const std::vector<const char*>& names) {
    Findings found;
    for (const char* name : names) {
      found.effects.push_back({.name = name, .nats = 9});
    }
    return measure_gap(records, explanation, found).by_feature[2];
  };
  const auto both = spectrum_with({"floor_vibration", "electrical_line"});
  const auto one = spectrum_with({"floor_vibration"});
  EXPECT_EQ(one[0], both[0]);
  EXPECT_NEAR(one[1] * one[1] - both[1] * both[1], (both[0] * both[0] - both[1] * both[1]) / 2,
              1e-9);
}

}  // namespace
}  // namespace sixpoint::gap
