#include "gap/features/tones.h"

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

Bundle one_tone(double frequency_hz, double amplitude_g,
                const std::function<double(std::size_t)>& slip, std::size_t samples = 1000) {
  Bundle bundle;
  Segment segment;
  segment.name = "shaker";
  segment.kind = Segment::Kind::vibration;
  segment.samples = samples;
  segment.starts_placement = false;
  segment.vibration = Vibration{Eigen::Vector3d::UnitZ(), frequency_hz, amplitude_g};
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 1);
  for (std::size_t n = 0; n < samples; ++n) {
    const double t = (static_cast<double>(n) + slip(n)) / 100;
    const double z = 1 + amplitude_g * std::cos(2 * M_PI * frequency_hz * t + 1);
    bundle.samples.push_back({static_cast<std::int16_t>(std::lround(normal(random))),
                              static_cast<std::int16_t>(std::lround(normal(random))),
                              static_cast<std::int16_t>(std::lround(256 * z + normal(random)))});
  }
  bundle.segments.push_back(segment);
  return bundle;
}

TEST(Tones, AmplitudeAndSlips) {
  for (const double f : {2.0, 7.0, 16.0, 40.0}) {
    for (const int steps : {0, 1, -1, 2}) {
      const Bundle bundle = one_tone(f, 0.6, [&](std::size_t n) { return n >= 430 ? steps : 0; });
      const auto fits = fit_tones(bundle, clean_samples(bundle), {});
      ASSERT_EQ(fits.size(), 1U);
      SCOPED_TRACE(testing::Message() << f << " Hz, " << steps << " steps");
      ASSERT_TRUE(fits[0].usable);
      if (steps == 0) {
        EXPECT_TRUE(fits[0].slips.empty());
        EXPECT_NEAR(fits[0].in_phase_mg[2], 600, 5 * 4.1 * std::sqrt(2.0 / 1000));
        EXPECT_NEAR(fits[0].frequency_ppm, 0, 5 * fits[0].frequency_sd_ppm);
        EXPECT_NEAR(fits[0].level_mg[2], 1000, 0.7);
      } else {
        ASSERT_EQ(fits[0].slips.size(), 1U);
        EXPECT_EQ(fits[0].slips[0].steps, steps);
        EXPECT_NEAR(static_cast<double>(fits[0].slips[0].sample), 430, 8);
      }
    }
  }
}

// The host's clock may be known to some ppm only: what its error leaves is an even drift of the
// phase and no row of steps, even where the tone is large. A sample that is lost is found beside
// it.
TEST(Tones, AnEvenDriftIsNoRowOfSlips) {
  for (const double ppm : {-200.0, -60.0, -17.0, -5.0, 7.0, 23.0, 90.0, 310.0}) {
    for (const double amplitude_g : {0.6, 2.0}) {
      SCOPED_TRACE(testing::Message() << ppm << " ppm, " << amplitude_g << " g");
      const auto drifting = [&](std::size_t n) { return static_cast<double>(n) * ppm * 1e-6; };
      const Bundle bundle = one_tone(40, amplitude_g, drifting);
      const ToneFit fit = fit_tones(bundle, clean_samples(bundle), {}).front();
      EXPECT_TRUE(fit.slips.empty());
      EXPECT_NEAR(fit.frequency_ppm, ppm, 5 * fit.frequency_sd_ppm);
    }
  }
  const Bundle slipped = one_tone(
      16, 0.6, [](std::size_t n) { return static_cast<double>(n) * 10e-6 + (n >= 430 ? 1 : 0); });
  const ToneFit fit = fit_tones(slipped, clean_samples(slipped), {}).front();
  ASSERT_EQ(fit.slips.size(), 1U);
  EXPECT_EQ(fit.slips[0].steps, 1);
}

// Oracle: the drift that is put in, of tones that are longer than any of a protocol. The search for it
// begins on a stretch of them.
TEST(Tones, AnEvenDriftOfALongToneIsFound) {
  for (const double ppm : {-61.0, 5'000.0}) {
    const auto drifting = [&](std::size_t n) { return static_cast<double>(n) * ppm * 1e-6; };
    const Bundle bundle = one_tone(40, 0.6, drifting, 50'000);
    const ToneFit fit = fit_tones(bundle, clean_samples(bundle), {}).front();
    EXPECT_TRUE(fit.slips.empty()) << ppm;
    EXPECT_NEAR(fit.frequency_ppm, ppm, 5 * fit.frequency_sd_ppm);
  }
}

// What is left of a tone of 11 g that is clipped at 8 g shows its curve: y = z + K3 z^3 at a level of
// 1 g. Oracle: the harmonics of (1 + A cos p)^3 by hand.
TEST(Tones, AClippedToneShowsThirdOrder) {
  constexpr double kThird_mg_per_g3 = 0.2;
  constexpr double kAmplitude_g = 11;
  Bundle bundle = one_tone(19.3, kAmplitude_g, [](std::size_t) { return 0; });
  for (gt3x::Counts& counts : bundle.samples) {
    const double z = counts[2] / 256.0;
    const double curved_lsb = 0.256 * kThird_mg_per_g3 * z * z * z;
    counts[2] = static_cast<std::int16_t>(
        std::clamp<long>(std::lround(counts[2] + curved_lsb), -2048, 2047));
  }
  const ToneFit fit = fit_tones(bundle, clean_samples(bundle), {}).front();
  ASSERT_TRUE(fit.usable);
  EXPECT_NEAR(fit.clipped_share, 0.48, 0.03) << "above 7 g and below -9 g";
  constexpr double kCubic = kThird_mg_per_g3 * kAmplitude_g * kAmplitude_g * kAmplitude_g;
  const auto sd_mg = [&](Eigen::Index i) { return 4.2 * std::sqrt(fit.covariance_shape(i, i)); };
  EXPECT_NEAR(fit.third_mg, kCubic / 4, 4 * sd_mg(3));
  EXPECT_LT(sd_mg(3), 3);
  EXPECT_NEAR(fit.in_phase_mg[2],
              1000 * kAmplitude_g + kThird_mg_per_g3 * 3 * kAmplitude_g + 0.75 * kCubic,
              4 * sd_mg(1));
}

// A line of A at a distance of d Hz adds A sinc(d T) to a tone of T seconds, in any phase.
TEST(Tones, LinesNearbyMakeAmplitudesUncertain) {
  const Bundle bundle = one_tone(10, 0.6, [](std::size_t) { return 0; });
  SpectralLine line;
  line.frequency_hz = 10.05;
  line.vector_mg = {0, 2, 4};
  const auto fit = fit_tones(bundle, clean_samples(bundle), {.lines = {line}}).front();
  const double turns = M_PI * 0.05 * static_cast<double>(fit.samples) / 100;
  const double share = std::sin(turns) / turns;
  EXPECT_NEAR(fit.line_mg2[0][2], 16 * share * share / 2, 0.01);
  EXPECT_NEAR(fit.line_mg2[0][1], 4 * share * share / 2, 0.01);
  EXPECT_LT(fit.line_mg2[1][2], 0.01) << "10 Hz off the second harmonic";
  const auto without = fit_tones(bundle, clean_samples(bundle), {}).front();
  EXPECT_EQ(without.line_mg2[0][2], 0);
  EXPECT_GT(fit.frequency_sd_ppm, 5 * without.frequency_sd_ppm);
}

TEST(Tones, JitterShowsOnSlopes) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal(0, 0.05);  // 0.5 ms
  const Bundle bundle = one_tone(16, 1, [&](std::size_t) { return normal(random); });
  const auto fit = fit_tones(bundle, clean_samples(bundle), {}).front();
  const double rate = 2 * M_PI * 16 * 1000 * 0.5e-3;  // mg of jitter at the steepest
  EXPECT_TRUE(fit.slips.empty());
  EXPECT_NEAR(fit.on_slope_mg2 - fit.on_crest_mg2, rate * rate / 2, 0.2 * rate * rate / 2);
}

}  // namespace
}  // namespace sixpoint::gap
