#include "gap/features/settling.h"

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

TEST(Settling, FrequencyDecayAndShare) {
  const Bundle bundle = tests::made_production({}, [](const Segment& s, double t) {
    return Eigen::Vector3d(s.rotation.col(2) -
                           0.03 * std::exp(-t / 0.4) * std::cos(2 * M_PI * 6.5 * t) * s.approach_g);
  });
  const CleanSamples clean = clean_samples(bundle);
  const StepResponse step = step_response(bundle, clean, noise_spectrum(bundle, clean));
  ASSERT_TRUE(step.usable);
  EXPECT_NEAR(step.amplitude, 0.03, 0.0015);
  EXPECT_NEAR(step.mode.frequency_hz, 6.5, 0.05);
  EXPECT_NEAR(step.mode.decay_s, 0.4, 0.04);
  EXPECT_GT(step.gain_nats, 100);
}

// A line of 8 mg whose phase at each move happens to be alike looks like ringing; its frequency is
// known, and the rest of each dwell holds it without the moves.
TEST(Settling, ALineIsNoRinging) {
  const Bundle bundle = tests::made_production({}, [](const Segment& s, double t) {
    return Eigen::Vector3d(s.rotation.col(2) + 0.008 * std::cos(2 * M_PI * 7.3 * t) * s.approach_g);
  });
  const CleanSamples clean = clean_samples(bundle);
  const NoiseSpectrum noise = noise_spectrum(bundle, clean);
  EXPECT_GT(step_response(bundle, clean, noise).gain_nats, 100);
  const StepResponse step = step_response(bundle, clean, noise, {7.3});
  ASSERT_TRUE(step.usable);
  EXPECT_LT(step.gain_nats, 12) << "the largest of some hundred frequencies and decays";
}

TEST(Settling, NotUsableWithoutSteps) {
  Bundle bundle = tests::made_production({});
  for (Segment& segment : bundle.segments) {
    segment.approach_g.setZero();
  }
  const CleanSamples clean = clean_samples(bundle);
  EXPECT_FALSE(step_response(bundle, clean, noise_spectrum(bundle, clean)).usable);
}

TEST(Settling, ModeIsADampedCosine) {
  const StepResponse::Mode mode{0.03, 0, 5, 0.4, 0};
  EXPECT_NEAR(mode.at(0), 0.03, 1e-15);
  EXPECT_NEAR(mode.at(0.2), 0.03 * std::exp(-0.5), 1e-12);  // one period on
}

}  // namespace
}  // namespace sixpoint::gap
