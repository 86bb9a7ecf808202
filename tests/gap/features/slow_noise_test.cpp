#include "gap/features/slow_noise.h"

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

TEST(SlowNoise, WalkIsFoundAndSized) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Eigen::Vector3d walk = Eigen::Vector3d::Zero();
  const auto force = [&](const Segment& s, double) {
    for (Eigen::Index a = 0; a < 3; ++a) {
      walk[a] += 0.3e-3 * 0.1 * normal(random);  // 0.3 mg per sqrt(s) at 100 Hz
    }
    return Eigen::Vector3d(s.rotation.col(2) + walk);
  };
  const Bundle bundle = tests::made_production({}, force);
  const CleanSamples clean = clean_samples(bundle);
  const SlowNoise slow = slow_noise(bundle, clean, noise_spectrum(bundle, clean));
  EXPECT_GT(slow.best().nats, 20);
  EXPECT_NEAR(slow.best().walk_mg, 0.3, 0.1);
  const Bundle still = tests::made_production({});
  const CleanSamples still_clean = clean_samples(still);
  EXPECT_LT(slow_noise(still, still_clean, noise_spectrum(still, still_clean)).best().nats, 5);
}

// Telegraph noise of 2 mg against a walk of the same power: only the first has jumps.
TEST(SlowNoise, JumpsAreNoWalk) {
  const auto jump_sd = [](bool telegraph) {
    Bundle bundle = tests::made_production({});
    Segment still = bundle.segments.front();
    bundle.segments.clear();
    bundle.samples.clear();
    still.first_sample = 0;
    still.samples = 100'000;
    std::mt19937_64 random(5);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    double level_mg = 0;
    for (std::size_t i = 0; i < still.samples; ++i) {
      if (telegraph) {
        level_mg = uniform(random) < 1.0 / 2500 ? 2 - level_mg : level_mg;
      } else {
        level_mg += 0.02 * normal(random);
      }
      const double mg = 100 + level_mg + 3.9 * normal(random);
      bundle.samples.push_back({static_cast<std::int16_t>(std::lround(mg * 0.256)),
                                static_cast<std::int16_t>(std::lround(mg * 0.256)), 256});
    }
    bundle.segments.push_back(still);
    const CleanSamples clean = clean_samples(bundle);
    return slow_noise(bundle, clean, noise_spectrum(bundle, clean)).jump_sd;
  };
  EXPECT_GT(jump_sd(true), 8);
  EXPECT_LT(jump_sd(false), 4);
}

// By hand: one mode of variance 1 + 3 on one axis, tried with the right size, with none, and with
// another.
TEST(SlowNoise, ExpectedEvidenceIsThatOfTwoVariances) {
  SlowNoise slow;
  slow.modes.push_back({.white_mg2 = {2, 0, 0}, .walk = 6, .flicker = 1.5});
  EXPECT_NEAR(slow.expected_nats(false, 1, 1), 0.5 * (3 - std::log(4.0)), 1e-12);
  EXPECT_NEAR(slow.expected_nats(true, 2, 2), 0.5 * (3 - std::log(4.0)), 1e-12);
  EXPECT_EQ(slow.expected_nats(false, 1, 0), 0);
  EXPECT_LT(slow.expected_nats(false, 0, 1), 0) << "there is none";
  EXPECT_LT(slow.expected_nats(false, 1, 2), slow.expected_nats(false, 1, 1));
}

}  // namespace
}  // namespace sixpoint::gap
