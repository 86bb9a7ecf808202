#include "gap/features/lines.h"

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

TEST(Lines, FrameIsTold) {
  const Eigen::Vector3d v(1.2e-3, -0.4e-3, 0.8e-3);
  for (const bool lab : {true, false}) {
    const Bundle bundle = tests::made_production({}, [&](const Segment& s, double t) {
      const Eigen::Vector3d line = std::cos(2 * M_PI * 17.3 * (s.host_start_s + t)) * v;
      return Eigen::Vector3d(s.rotation.col(2) + (lab ? Eigen::Vector3d(s.rotation * line) : line));
    });
    const CleanSamples clean = clean_samples(bundle);
    const auto lines = find_lines(bundle, clean, noise_spectrum(bundle, clean));
    ASSERT_EQ(lines.size(), 1U);
    EXPECT_EQ(lines[0].in_lab, lab);
    EXPECT_TRUE(lines[0].decidable);
    EXPECT_NEAR(lines[0].frequency_hz, 17.3, 0.02);
    const double apart =
        std::min((lines[0].vector_mg - 1000 * v).norm(), (lines[0].vector_mg + 1000 * v).norm());
    EXPECT_LT(apart, 6 * lines[0].sd_mg);
  }
  const Bundle none = tests::made_production({});
  const CleanSamples clean = clean_samples(none);
  EXPECT_TRUE(find_lines(none, clean, noise_spectrum(none, clean)).empty());
}

// A line whose phase is another in each dwell, about twice a dwell's noise. Taking the likeliest
// phase of each dwell makes it a tenth larger.
TEST(Lines, NoiseDoesNotMakeASmallLineLarger) {
  const Eigen::Vector3d v(0.45e-3, -0.3e-3, 0.4e-3);
  double sum = 0;
  double square_sd = 0;
  constexpr int kSeeds = 12;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const Bundle bundle = tests::made_production(
        {.seed = static_cast<unsigned>(seed)}, [&](const Segment& s, double t) {
          const double phase = 2.4 * s.placement * s.placement;
          return Eigen::Vector3d(s.rotation.col(2) + std::cos(2 * M_PI * 17.3 * t + phase) * v);
        });
    const CleanSamples clean = clean_samples(bundle);
    const auto lines = find_lines(bundle, clean, noise_spectrum(bundle, clean));
    ASSERT_EQ(lines.size(), 1U) << seed;
    sum += lines[0].vector_mg.norm() / (1000 * v.norm());
    EXPECT_GT(lines[0].held_out_nats, 0) << "each half of the poses predicts the other: " << seed;
    square_sd += std::pow(lines[0].sd_mg / (1000 * v.norm()), 2);
  }
  EXPECT_NEAR(sum / kSeeds, 1, 3 * std::sqrt(square_sd) / kSeeds);
}

}  // namespace
}  // namespace sixpoint::gap
