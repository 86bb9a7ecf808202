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
  found.outside_means_mg2 = {4, 5};
  const Bundle bundle;
  const DiagnoseOptions options;
  found.add({bundle, options}, {.name = "wrap", .nats = 9});
  const GapSize more = measure_gap({}, explanation, found);
  EXPECT_NEAR(more.before_mg, std::hypot(plain.before_mg, 3), 1e-12);
  EXPECT_GT(more.closed_fraction, 0.98) << "the effect explains all of it";
  found.effects.clear();
  found.alarm(10, "somewhere");
  EXPECT_EQ(measure_gap({}, explanation, found).after_mg, more.before_mg) << "nothing is named";
}

}  // namespace
}  // namespace sixpoint::gap
