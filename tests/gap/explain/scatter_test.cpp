#include "gap/explain/scatter.h"

#include <gtest/gtest.h>

#include "gap/explain/made_blocks.h"

namespace sixpoint::gap {
namespace {

TEST(Scatter, NamesAndMembership) {
  EXPECT_EQ(to_string(Scatter::random_walk), "random_walk");
  EXPECT_EQ(to_string(Scatter::by_session), "session");
  EXPECT_EQ(to_string(Scatter::seat_walks), "a seat that walks");
  EXPECT_EQ(to_string(Scatter::step), "a step of the zero");
  EXPECT_TRUE(in_catalogue(Scatter::flicker));
  EXPECT_FALSE(in_catalogue(Scatter::by_pose));
}

TEST(Scatter, SizesAscendAndShareThePrior) {
  for (const Scatter scatter : {Scatter::seating, Scatter::random_walk, Scatter::flicker,
                                Scatter::by_pose, Scatter::seat_walks, Scatter::by_time_fast}) {
    const std::vector<double> sizes = sizes_of(scatter);
    EXPECT_TRUE(std::is_sorted(sizes.begin(), sizes.end()));
    const double all = in_catalogue(scatter) ? -3.5 : scatter == Scatter::seat_walks ? -11.5 : -4.5;
    EXPECT_NEAR(scatter_log_prior(scatter), all - std::log(static_cast<double>(sizes.size())),
                1e-12);
  }
}

// A walk W(t) of 1 mg/sqrt(s) from the start: cov(W(s), W(t)) = min(s, t); the variance of its mean
// over a block that begins at a and lasts d is a + d / 3.
TEST(Scatter, RandomWalkKernel) {
  const auto blocks = tests::made_dwells();
  const double start_s = blocks.front().middle_s - 5;
  EXPECT_NEAR(scatter_kernel(Scatter::random_walk, blocks[2], blocks[2], start_s), 120 + 10.0 / 3,
              1e-9);
  EXPECT_NEAR(scatter_kernel(Scatter::random_walk, blocks[2], blocks[7], start_s), 125, 1e-9);
  EXPECT_NEAR(scatter_kernel(Scatter::random_walk, blocks[7], blocks[2], start_s), 125, 1e-9);
}

// 1/f noise: the variance of the difference of two means hardly depends on their distance; the sum
// of processes keeps the covariance falling and below the variance.
TEST(Scatter, FlickerKernelFallsWithTime) {
  const auto blocks = tests::made_dwells();
  double last = scatter_kernel(Scatter::flicker, blocks[0], blocks[0], 0);
  for (std::size_t i = 1; i < blocks.size(); ++i) {
    const double now = scatter_kernel(Scatter::flicker, blocks[0], blocks[i], 0);
    EXPECT_LT(now, last);
    EXPECT_GT(now, 0);
    last = now;
  }
}

TEST(Scatter, KernelsOfUnknownCauses) {
  auto blocks = tests::made_dwells();
  Block& a = blocks[0];
  Block& b = blocks[1];
  EXPECT_EQ(scatter_kernel(Scatter::by_session, a, b, 0), 1);
  EXPECT_EQ(scatter_kernel(Scatter::by_session, a, blocks[6], 0), 0);
  EXPECT_EQ(scatter_kernel(Scatter::by_pose, a, b, 0), 0);
  b.rotation = a.rotation;
  EXPECT_EQ(scatter_kernel(Scatter::by_pose, a, b, 0), 1);
  a.temperature_c = 20;
  b.temperature_c = 30;
  EXPECT_NEAR(scatter_kernel(Scatter::by_temperature, a, b, 0), std::exp(-0.5), 1e-12);
  b.middle_s = a.middle_s + 700;
  EXPECT_NEAR(scatter_kernel(Scatter::by_time, a, b, 0), std::exp(-0.5), 1e-12);
  b.vibration_lab_g = {0, 0, 2};
  b.placement = a.placement;
  EXPECT_NEAR(scatter_kernel(Scatter::by_placement, a, b, 0), 2, 1e-12);  // 1 + 2^2 / 4
}

// One hundredth of a degree turns 1 g by 0.1745 mg into each horizontal axis, not into the
// vertical.
TEST(Scatter, NominalVarianceIsNoiseAndSeating) {
  const auto blocks = tests::made_dwells();
  const double noise2 = tests::kMeanNoise_mg * tests::kMeanNoise_mg;
  const double seat2 = std::pow(1000 * std::sin(0.01 * M_PI / 180), 2);
  EXPECT_NEAR(nominal_variance_mg2(blocks[0], 0), noise2, 1e-9);
  EXPECT_NEAR(nominal_variance_mg2(blocks[0], 1), noise2 + seat2, 1e-6);
  EXPECT_NEAR(nominal_variance_mg2(blocks[0], 2), noise2 + seat2, 1e-6);
}

}  // namespace
}  // namespace sixpoint::gap
