#include "gap/features/response.h"

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

// A usable fit of a tone along z, whose amplitude came through `gain`.
void add_tone(Bundle& bundle, std::vector<ToneFit>& tones, double f_hz, double amplitude_g,
              double gain) {
  Segment segment;
  segment.kind = Segment::Kind::vibration;
  segment.vibration = Vibration{Eigen::Vector3d::UnitZ(), f_hz, amplitude_g};
  ToneFit tone;
  tone.segment = bundle.segments.size();
  tone.axis = 2;
  tone.usable = true;
  tone.samples = 1000;
  tone.in_phase_mg[2] = 1000 * amplitude_g * gain;
  tone.residual_mg = 4;
  bundle.segments.push_back(segment);
  tones.push_back(tone);
}

TEST(Response, ClosedForms) {
  EXPECT_NEAR(low_pass_gain(20, 20, 4, 100), M_SQRT1_2, 1e-12);
  EXPECT_NEAR(low_pass_gain(1, 30, 4, 100), 1, 1e-6);
  const Resonance plain{12, 3, ResonanceForm::second_order, 0};
  EXPECT_NEAR(resonance_gain(12, plain), 3, 1e-12);  // Q at resonance
  EXPECT_NEAR(resonance_gain(12, Resonance{12, 3, ResonanceForm::base_excited, 0}), std::sqrt(10.0),
              1e-12);  // sqrt(1 + Q^2)
  EXPECT_NEAR(resonance_gain(0.01, plain), 1, 1e-5);
  EXPECT_NEAR(resonance_gain(12, Resonance{12, 3, ResonanceForm::peak, 0}), 3, 1e-12);
  LowPass analogue;
  analogue.corner_hz = 20;
  analogue.order = 2;
  analogue.form = LowPassForm::analogue;
  EXPECT_NEAR(analogue.tone_gain(20, 100), M_SQRT1_2, 1e-12);
  // What lies beyond half the rate comes back: at half of it twice the power.
  EXPECT_NEAR(std::pow(analogue.noise_gain(50, 100), 2),
              2 / (1 + std::pow(2.5, 4)) + 1 / (1 + std::pow(7.5, 4)), 1e-12);
}

// Oracle: an ideal low-pass at a quarter of half the rate leaves one free number in four samples
// (Nyquist); a filter of order 8 is nearly one.
TEST(Response, FilteredNoiseHasFewerFreeSamples) {
  Response response;
  EXPECT_NEAR(response.correlated_samples(100), 1, 1e-12);
  response.low_pass.corner_hz = 12.5;
  response.low_pass.order = 8;
  EXPECT_NEAR(response.correlated_samples(100), 1, 1e-12) << "not significant";
  response.low_pass_significant = true;
  EXPECT_NEAR(response.correlated_samples(100), 4, 0.4);
}

// Tones at 0.9 of their amplitude on a mount of 14 Hz; the gain is of the axis, not of the mount.
TEST(Response, TonesBehindAResonanceGiveItsFrequencyAndQ) {
  Bundle bundle;
  std::vector<ToneFit> tones;
  const Resonance mount{14, 2.5, ResonanceForm::second_order, 0};
  for (const double f_hz : {2.0, 4.0, 7.0, 10.0, 13.0, 16.0, 25.0, 40.0}) {
    add_tone(bundle, tones, f_hz, 0.5, 0.9 * resonance_gain(f_hz, mount));
  }
  const Response response = find_response(bundle, {}, tones, {});
  ASSERT_TRUE(response.resonance_significant);
  EXPECT_NEAR(response.resonance.frequency_hz, 14, 0.01);
  EXPECT_NEAR(response.resonance.q, 2.5, 0.01);
  EXPECT_FALSE(response.low_pass_significant);
}

// Noise of 4 mg behind this sampled low-pass of second order.
NoiseSpectrum noise_behind(const Bundle& bundle, double corner_hz, std::size_t blocks) {
  const double rounding_mg2 = std::pow(1000.0 / bundle.accel_scale_lsb_per_g, 2) / 12;
  NoiseSpectrum noise;
  noise.blocks = blocks;
  noise.white_mg = {4, 4, 4};
  for (int k = 1; k < 64; ++k) {
    const double f_hz = k * bundle.rate_hz / 2 / 64;
    const double h = low_pass_gain(f_hz, corner_hz, 2, bundle.rate_hz);
    noise.frequency_hz.push_back(f_hz);
    for (std::vector<double>& variance_mg2 : noise.variance_mg2) {
      variance_mg2.push_back(16 * h * h + rounding_mg2);
    }
  }
  return noise;
}

// A mount of 16 Hz before a filter of 22 Hz: the noise has passed the filter alone, the tones both.
TEST(Response, TheNoiseTellsAFilterFromTheMountBeforeIt) {
  Bundle bundle;
  bundle.rate_hz = 100;
  bundle.accel_scale_lsb_per_g = 256;
  const auto filter = [](double f_hz) { return low_pass_gain(f_hz, 22, 2, 100); };
  const NoiseSpectrum noise = noise_behind(bundle, 22, 400);
  const Resonance mount{16, 2.5, ResonanceForm::second_order, 0};
  std::vector<ToneFit> tones;
  for (const double f_hz : {2.0, 3.0, 5.0, 8.0, 12.0, 15.0, 20.0, 30.0, 40.0}) {
    add_tone(bundle, tones, f_hz, 1, filter(f_hz) * resonance_gain(f_hz, mount));
  }
  const Response response = find_response(bundle, noise, tones, {});
  ASSERT_TRUE(response.low_pass_significant);
  ASSERT_TRUE(response.resonance_significant);
  EXPECT_EQ(response.low_pass.order, 2);
  EXPECT_NEAR(response.low_pass.corner_hz, 22, 0.1);
  EXPECT_NEAR(response.resonance.frequency_hz, 16, 0.1);
  EXPECT_NEAR(response.resonance.q, 2.5, 0.05);
}

// Tones through a filter in front of the sampler (Butterworth, 1 / sqrt(1 + (f / corner)^4)) behind
// a mount, and noise as of a sampled filter: the noise alone takes the tones' filter for another.
TEST(Response, TheFormOfAFilterBehindAMountIsTheTones) {
  Bundle bundle;
  bundle.rate_hz = 100;
  bundle.accel_scale_lsb_per_g = 256;
  const NoiseSpectrum noise = noise_behind(bundle, 33.6, 2000);
  const Resonance mount{13.3, 1.85, ResonanceForm::base_excited, 0};
  std::vector<ToneFit> tones;
  for (const double f_hz : {2.0, 3.0, 5.0, 8.0, 12.0, 15.0, 20.0, 30.0, 40.0}) {
    add_tone(bundle, tones, f_hz, 1,
             resonance_gain(f_hz, mount) / std::sqrt(1 + std::pow(f_hz / 33.6, 4)));
  }
  const Response response = find_response(bundle, noise, tones, {});
  ASSERT_TRUE(response.low_pass_significant);
  ASSERT_TRUE(response.resonance_significant);
  EXPECT_NEAR(response.low_pass.corner_hz, 33.6, 0.2);
  EXPECT_NEAR(response.resonance.frequency_hz, 13.3, 0.05);
  EXPECT_NEAR(response.resonance.q, 1.85, 0.02);
  EXPECT_LT(response.tone_left_sd, 1);
}

}  // namespace
}  // namespace sixpoint::gap
