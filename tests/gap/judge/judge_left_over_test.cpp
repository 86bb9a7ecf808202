#include <gtest/gtest.h>

#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

// A walk of 0.3 mg/sqrt(s) less its mean over 30 s: q^2 T / 6. 1/f noise between 1/30 s and 50 Hz:
// F^2 ln(30 * 50).
TEST(JudgeLeftOver, SlowVarianceInClosedForm) {
  const Bundle bundle;
  const DiagnoseOptions options;
  Findings found;
  Fit fit;
  fit.scatter = Scatter::random_walk;
  fit.scatter_size = 0.3;
  EXPECT_EQ(slow_variance_mg2(fit, found, 30, 100), 0) << "not accepted";
  found.add({bundle, options}, {.name = "random_walk", .nats = 9});
  found.add({bundle, options}, {.name = "flicker", .nats = 9});
  EXPECT_NEAR(slow_variance_mg2(fit, found, 30, 100), 0.09 * 30 / 6, 1e-12);
  fit.scatter = Scatter::flicker;
  EXPECT_NEAR(slow_variance_mg2(fit, found, 30, 100),
              flicker_density_mg2(0.3) * std::log(30 * 50.0), 1e-12);
}

}  // namespace
}  // namespace sixpoint::gap
