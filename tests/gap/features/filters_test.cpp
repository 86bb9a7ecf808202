// The tests of response.h have |H| at the corner and at resonance; here the forms between them.
#include "gap/features/filters.h"

#include <cmath>
#include <complex>

#include <gtest/gtest.h>

namespace sixpoint::gap {
namespace {

LowPass low_pass(double corner_hz, int order, LowPassForm form) {
  LowPass filter;
  filter.corner_hz = corner_hz;
  filter.order = order;
  filter.form = form;
  return filter;
}

// At half its corner a Butterworth low-pass of order n has the power 1 / (1 + 4^-n), at twice
// 1 / (1 + 4^n).
double octave_below(int order) { return 1 / std::sqrt(1 + std::pow(4.0, -order)); }
double octave_above(int order) { return 1 / std::sqrt(1 + std::pow(4.0, order)); }

TEST(Filters, LowPassHasHalfThePowerAtItsCornerAtEveryOrderAndRate) {
  for (int order = 1; order <= 8; ++order) {
    for (const double rate_hz : {30.0, 100.0, 400.0}) {
      for (const double share : {0.05, 0.25, 0.45}) {
        const double corner_hz = share * rate_hz;
        EXPECT_NEAR(low_pass_gain(corner_hz, corner_hz, order, rate_hz), M_SQRT1_2, 1e-12)
            << "order " << order << ", " << corner_hz << " of " << rate_hz << " Hz";
      }
    }
  }
}

// Oracle: the filter itself. The bilinear transform makes of 1 / (1 + s / w) the recursion
// y[n] = b (x[n] + x[n-1]) - a y[n-1] with w = tan(pi fc / fs), b = w / (1 + w), a = (w - 1) / (w +
// 1).
TEST(Filters, LowPassOfOrderOneIsTheRecursionOfTheBilinearTransform) {
  const double w = std::tan(M_PI * 20 / 100);
  const double b = w / (1 + w);
  const double a = (w - 1) / (w + 1);
  for (const double f : {0.0, 3.0, 12.5, 31.0, 44.0, 49.0}) {
    const std::complex<double> delay = std::polar(1.0, -2 * M_PI * f / 100);
    const double expected = std::abs(b * (1.0 + delay) / (1.0 + a * delay));
    EXPECT_NEAR(low_pass_gain(f, 20, 1, 100), expected, 1e-12) << f << " Hz";
  }
}

// A quarter of the rate and the frequency whose tangent is half of tan(pi/4) are an octave apart.
TEST(Filters, LowPassIsWarpedAsTheBilinearTransformSays) {
  const double below_hz = 100 * std::atan(0.5) / M_PI;  // 14.76 Hz, not 12.5
  const double above_hz = 100 * std::atan(2.0) / M_PI;  // 35.24 Hz, not 50
  for (int order = 1; order <= 8; ++order) {
    EXPECT_NEAR(low_pass_gain(below_hz, 25, order, 100), octave_below(order), 1e-12);
    EXPECT_NEAR(low_pass_gain(above_hz, 25, order, 100), octave_above(order), 1e-12);
  }
}

TEST(Filters, LowPassIsFiniteAndNearZeroAtHalfTheRateAndBeyond) {
  for (const double f : {50.0, 60.0, 1000.0}) {
    const double gain = low_pass_gain(f, 25, 4, 100);
    EXPECT_GE(gain, 0);
    EXPECT_LT(gain, 1e-9) << f << " Hz";
  }
}

// The table of LowPassForm: what of a filter is in front of the sampler, the tones' part or both.
TEST(Filters, FormDecidesWhetherTonesAndNoiseSeeTheSampledFilter) {
  const double half_corner_hz = 12.5;
  const double analogue = octave_below(2);
  const double sampled = low_pass_gain(half_corner_hz, 25, 2, 100);
  ASSERT_GT(std::abs(sampled - analogue), 0.005);

  const LowPass first = low_pass(25, 2, LowPassForm::sampled);
  EXPECT_NEAR(first.tone_gain(half_corner_hz, 100), sampled, 1e-12);
  EXPECT_NEAR(first.noise_gain(half_corner_hz, 100), sampled, 1e-12);

  const LowPass mixed = low_pass(25, 2, LowPassForm::mixed);
  EXPECT_NEAR(mixed.tone_gain(half_corner_hz, 100), analogue, 1e-12);
  EXPECT_NEAR(mixed.noise_gain(half_corner_hz, 100), sampled, 1e-12);

  const LowPass both = low_pass(25, 2, LowPassForm::analogue);
  EXPECT_NEAR(both.tone_gain(half_corner_hz, 100), analogue, 1e-12);
  // Folded from 87.5 and 112.5 Hz, 3.5 and 4.5 corners away.
  EXPECT_NEAR(std::pow(both.noise_gain(half_corner_hz, 100), 2),
              1 / (1 + std::pow(0.5, 4)) + 1 / (1 + std::pow(3.5, 4)) + 1 / (1 + std::pow(4.5, 4)),
              1e-12);
}

// Three forms of one mount of 10 Hz, Q 4, an octave away from its resonance.
//   second order   1 / |1 - r^2 + i r / Q|
//   base excited   |1 + i r / Q| / |1 - r^2 + i r / Q|
//   peak           1 + (Q - 1) / (1 + (2 Q (r - 1))^2)
TEST(Filters, ResonanceFormsDifferAwayFromTheirResonance) {
  Resonance mount;
  mount.frequency_hz = 10;
  mount.q = 4;
  mount.form = ResonanceForm::second_order;
  EXPECT_NEAR(resonance_gain(20, mount), 1 / std::sqrt(9 + 0.25), 1e-12);
  EXPECT_NEAR(resonance_gain(5, mount), 1 / std::sqrt(0.5625 + 1.0 / 64), 1e-12);
  mount.form = ResonanceForm::base_excited;
  EXPECT_NEAR(resonance_gain(20, mount), std::sqrt(1.25 / 9.25), 1e-12);
  mount.form = ResonanceForm::peak;
  EXPECT_NEAR(resonance_gain(20, mount), 1 + 3.0 / 65, 1e-12);
  EXPECT_NEAR(resonance_gain(5, mount), 1 + 3.0 / 17, 1e-12);
}

// A mount isolates above sqrt(2) of its resonance, at any damping: base excitation has gain 1
// there.
TEST(Filters, BaseExcitationHasGainOneAtRootTwoWhateverTheDamping) {
  for (const double q : {0.5, 1.0, 3.0, 20.0}) {
    Resonance mount;
    mount.frequency_hz = 14;
    mount.q = q;
    mount.form = ResonanceForm::base_excited;
    EXPECT_NEAR(resonance_gain(14 * M_SQRT2, mount), 1, 1e-12) << "Q " << q;
    EXPECT_LT(resonance_gain(20.5, mount), 1) << "Q " << q;
    EXPECT_GT(resonance_gain(19, mount), 1) << "Q " << q;
  }
}

TEST(Filters, NothingIsChangedAtFrequencyZero) {
  Resonance mount;
  mount.frequency_hz = 14;
  mount.q = 3;
  for (const ResonanceForm form : {ResonanceForm::base_excited, ResonanceForm::second_order}) {
    mount.form = form;
    EXPECT_EQ(resonance_gain(0, mount), 1);
  }
  EXPECT_EQ(low_pass_gain(0, 25, 4, 100), 1);
}

}  // namespace
}  // namespace sixpoint::gap
