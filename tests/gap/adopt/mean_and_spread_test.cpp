#include "gap/adopt/mean_and_spread.h"

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

// Thirteen trials of BCG vaccination (Colditz et al., JAMA 271, 698 (1994)): log relative risks and
// their variances, as they are printed in the literature. Oracle: the equation of Paule and Mandel
// solved by hand-written Python; the estimate of DerSimonian and Laird for them is 0.3088.
TEST(MeanAndSpread, AsPublishedForThirteenTrials) {
  const std::vector<double> value = {-0.8893, -1.5854, -1.3481, -1.4416, -0.2175, -0.7861, -1.6209,
                                     0.0120,  -0.4694, -1.3713, -0.3394, 0.4459,  -0.0173};
  std::vector<double> sd = {0.3256, 0.1946, 0.4154, 0.0200, 0.0512, 0.0069, 0.2230,
                            0.0040, 0.0564, 0.0730, 0.0124, 0.5325, 0.0714};
  for (double& x : sd) {
    x = std::sqrt(x);
  }
  const MeanAndSpread found = mean_and_spread(value, sd);
  EXPECT_EQ(found.units, 13U);
  EXPECT_NEAR(found.spread.value_or(0) * found.spread.value_or(0), 0.3181, 2e-4);
  EXPECT_NEAR(found.mean, -0.7150, 2e-4);
  EXPECT_NEAR(found.standard_uncertainty, 0.1809, 2e-3);
}

// Closed form: with equal uncertainties s the spread is sqrt(variance - s^2).
TEST(MeanAndSpread, EqualUncertaintiesHaveAClosedForm) {
  const std::vector<double> value = {1, 2, 3, 4, 5};
  const MeanAndSpread found = mean_and_spread(value, std::vector<double>(5, 1.0));
  EXPECT_NEAR(found.mean, 3, 1e-12);
  EXPECT_NEAR(found.spread.value_or(0), std::sqrt(2.5 - 1), 1e-9);
  EXPECT_NEAR(found.standard_uncertainty, std::sqrt(2.5 / 5), 1e-9);
}

TEST(MeanAndSpread, TheMeasurementsOwnUncertaintyIsNoSpread) {
  const std::vector<double> value = {1.0, 1.1, 0.9, 1.05};
  EXPECT_EQ(mean_and_spread(value, std::vector<double>(4, 0.2)).spread, 0.0);
  EXPECT_GT(mean_and_spread(value, std::vector<double>(4, 0.01)).spread.value_or(0), 0.05);
}

TEST(MeanAndSpread, OfOneUnitTheSpreadIsNotKnown) {
  const std::array<double, 1> value = {0.4};
  const std::array<double, 1> sd = {0.03};
  const MeanAndSpread found = mean_and_spread(value, sd);
  EXPECT_FALSE(found.spread.has_value());
  EXPECT_NEAR(found.mean, 0.4, 1e-12);
  EXPECT_NEAR(found.standard_uncertainty, 0.03, 1e-12);
}

TEST(MeanAndSpread, NumbersWithoutUncertaintyAreTakenAsTheyAre) {
  const MeanAndSpread zeros = mean_and_spread(std::vector<double>(3, 0), std::vector<double>(3, 0));
  EXPECT_EQ(zeros.mean, 0);
  EXPECT_EQ(zeros.spread, 0.0);
  EXPECT_EQ(zeros.standard_uncertainty, 0) << "none, and not a tiny one";
  const std::vector<double> value = {1, 3};
  const MeanAndSpread two = mean_and_spread(value, std::vector<double>(2, 0));
  EXPECT_NEAR(two.mean, 2, 1e-9);
  EXPECT_NEAR(two.spread.value_or(0), std::sqrt(2.0), 1e-6);
}

// Oracle: the population from which the numbers are drawn, by another generator. 400 populations of
// eight units, whose uncertainties differ by a factor of ten: two standard uncertainties hold the
// mean in at least 89 % (Student's t of seven degrees of freedom: 91.4 %; five standard deviations
// of 400 trials below that are 84 %), and the mean square of the spread has no bias.
TEST(MeanAndSpread, CoversTheTruth) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> log_size(std::log(0.03), std::log(0.3));
  int covered = 0;
  double spread2 = 0;
  constexpr int kTrials = 400;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> value;
    std::vector<double> sd;
    for (int unit = 0; unit < 8; ++unit) {
      sd.push_back(std::exp(log_size(random)));
      value.push_back(0.5 + 0.2 * normal(random) + sd.back() * normal(random));
    }
    const MeanAndSpread found = mean_and_spread(value, sd);
    covered += std::abs(found.mean - 0.5) < 2 * found.standard_uncertainty ? 1 : 0;
    spread2 += found.spread.value_or(0) * found.spread.value_or(0) / kTrials;
  }
  EXPECT_GT(covered, 0.87 * kTrials);
  EXPECT_NEAR(std::sqrt(spread2), 0.2, 0.02);
}

}  // namespace
}  // namespace sixpoint::gap
