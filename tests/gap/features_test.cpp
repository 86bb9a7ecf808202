// Each feature on data whose answer is known in closed form.
#include <gtest/gtest.h>

#include "gap/features/lines.h"
#include "gap/features/noise.h"
#include "gap/features/response.h"
#include "gap/features/settling.h"
#include "gap/features/slow_noise.h"
#include "gap/features/texture.h"
#include "gap/features/timing.h"
#include "gap/features/tones.h"
#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

TEST(HostTiming, ReadsRateAndSlipsExactly) {
  Bundle bundle = tests::made_production({});
  const HostTiming nominal = host_timing(bundle);
  EXPECT_NEAR(nominal.clock_ppm, 0, 4 * nominal.clock_sd_ppm);
  EXPECT_EQ(nominal.lost + nominal.repeated, 0U);
  EXPECT_NEAR(nominal.scatter_ms, 2 / std::sqrt(3.0), 5 * nominal.scatter_sd_ms);

  // 3000 ppm fast, two samples lost in the third second of segment 4, one repeated in segment 9.
  for (std::size_t i = 0; i < bundle.host_clock.sample_index.size(); ++i) {
    const std::size_t segment = i / 10;
    const auto second = static_cast<double>(i % 10);
    double& t = bundle.host_clock.host_time_s[i];
    t += second * (1 / 1.003 - 1);
    t += segment == 4 && i % 10 >= 3 ? 0.02 : 0;
    t -= segment == 9 && i % 10 >= 7 ? 0.01 : 0;
  }
  const HostTiming timing = host_timing(bundle);
  EXPECT_NEAR(timing.clock_ppm, 3000, 5 * timing.clock_sd_ppm);
  EXPECT_EQ(timing.lost, 2U);
  EXPECT_EQ(timing.repeated, 1U);
}

Bundle one_tone(double frequency_hz, double amplitude_g,
                const std::function<double(std::size_t)>& slip) {
  Bundle bundle;
  Segment segment;
  segment.name = "shaker";
  segment.kind = Segment::Kind::vibration;
  segment.samples = 1000;
  segment.starts_placement = false;
  segment.vibration = Vibration{Eigen::Vector3d::UnitZ(), frequency_hz, amplitude_g};
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 1);
  for (std::size_t n = 0; n < 1000; ++n) {
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

TEST(Tones, JitterShowsOnSlopes) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal(0, 0.05);  // 0.5 ms
  const Bundle bundle = one_tone(16, 1, [&](std::size_t) { return normal(random); });
  const auto fit = fit_tones(bundle, clean_samples(bundle), {}).front();
  const double rate = 2 * M_PI * 16 * 1000 * 0.5e-3;  // mg of jitter at the steepest
  EXPECT_TRUE(fit.slips.empty());
  EXPECT_NEAR(fit.on_slope_mg2 - fit.on_crest_mg2, rate * rate / 2, 0.2 * rate * rate / 2);
}

TEST(Lines, FrameIsTold) {
  const Eigen::Vector3d v(1.2e-3, -0.4e-3, 0.8e-3);
  for (const bool lab : {true, false}) {
    const Bundle bundle = tests::made_production({}, [&](const Segment& s, double t) {
      const Eigen::Vector3d line = std::cos(2 * M_PI * 17.3 * (s.host_start_s + t)) * v;
      return Eigen::Vector3d(s.rotation.col(2) + (lab ? Eigen::Vector3d(s.rotation * line) : line));
    });
    const CleanSamples clean = clean_samples(bundle);
    const LineSearch search = find_lines(bundle, clean, noise_spectrum(bundle, clean));
    ASSERT_EQ(search.lines.size(), 1U);
    EXPECT_EQ(search.lines[0].in_lab, lab);
    EXPECT_TRUE(search.lines[0].decidable);
    EXPECT_NEAR(search.lines[0].frequency_hz, 17.3, 0.02);
    const double apart = std::min((search.lines[0].vector_mg - 1000 * v).norm(),
                                  (search.lines[0].vector_mg + 1000 * v).norm());
    EXPECT_LT(apart, 6 * search.lines[0].sd_mg);
  }
  const Bundle none = tests::made_production({});
  const CleanSamples clean = clean_samples(none);
  EXPECT_TRUE(find_lines(none, clean, noise_spectrum(none, clean)).lines.empty());
}

TEST(Noise, WhiteLevelIncludesRounding) {
  const Bundle bundle = tests::made_production({});
  const NoiseSpectrum noise = noise_spectrum(bundle, clean_samples(bundle));
  ASSERT_TRUE(noise.usable());
  const double rounding = 1000.0 / 256 / std::sqrt(12.0);
  EXPECT_NEAR(noise.white_mg[0], std::hypot(3.9 * 1.01, rounding), 0.25);
  EXPECT_NEAR(noise.white_mg[2], std::hypot(5.5 * 1.02, rounding), 0.3);
  const CodeStatistics codes = code_statistics(bundle, clean_samples(bundle));
  EXPECT_LT(codes.spread_sd, 4);
  EXPECT_EQ(codes.outliers, 0U);
}

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
  EXPECT_GT(slow.best_walk().nats, 20);
  EXPECT_NEAR(slow.best_walk().walk_mg, 0.3, 0.1);
  const Bundle still = tests::made_production({});
  const CleanSamples still_clean = clean_samples(still);
  EXPECT_LT(slow_noise(still, still_clean, noise_spectrum(still, still_clean)).best_both().nats, 5);
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

// Gaussian noise of 3.9 mg, made by whoever asks, on top of the pose.
struct MadeNoise {
  std::mt19937_64 random{11};
  std::normal_distribution<double> normal{0, 0.0039};
  Eigen::Vector3d operator()() { return {normal(random), normal(random), normal(random)}; }
};

Texture texture_of(const tests::MadeForce& force) {
  tests::MadeUnit unit;
  unit.noise_g.setConstant(1e-6);
  const Bundle bundle = tests::made_production(unit, force);
  return noise_texture(bundle, clean_samples(bundle));
}

struct Worst {
  double tails = 0, dwells = 0, moments = 0, loudest = 0;
};
Worst worst_of(const Texture& texture) {
  Worst worst;
  for (const Texture::Scale& scale : texture.scales) {
    worst.tails = std::max(worst.tails, std::abs(scale.tails_sd));
    worst.dwells = std::max(worst.dwells, scale.dwells_sd);
    worst.moments = std::max(worst.moments, scale.moments_sd);
    worst.loudest = std::max(worst.loudest, scale.loudest_sd);
  }
  return worst;
}

// Thirty deviates by chance: beyond 4.5 once in ten thousand such tests.
void expect_plain(const Texture& texture) {
  EXPECT_EQ(texture.scales.size(), 8U);
  const Worst worst = worst_of(texture);
  EXPECT_LT(worst.tails, 4.5);
  EXPECT_LT(worst.dwells, 4.5);
  EXPECT_LT(worst.moments, 4.5);
  EXPECT_LT(worst.loudest, 4.5);
}

TEST(Texture, WhiteAndFilteredGaussianNoiseArePlain) {
  MadeNoise noise;
  expect_plain(texture_of(
      [&](const Segment& s, double) { return Eigen::Vector3d(s.rotation.col(2) + noise()); }));
  Eigen::Vector3d smooth = Eigen::Vector3d::Zero();
  expect_plain(texture_of([&](const Segment& s, double) {
    smooth = 0.6 * smooth + noise();
    return Eigen::Vector3d(s.rotation.col(2) + smooth);
  }));
}

TEST(Texture, WhatIsNoLinearFilterHasTails) {
  MadeNoise noise;
  Eigen::Vector3d held = Eigen::Vector3d::Constant(9);
  const Texture texture = texture_of([&](const Segment& s, double) {
    constexpr double kPlay_g = 0.002;
    const Eigen::Vector3d now = s.rotation.col(2) + noise();
    held =
        held.cwiseMax((now.array() - kPlay_g).matrix()).cwiseMin((now.array() + kPlay_g).matrix());
    return held;
  });
  EXPECT_GT(texture.scales.front().tails_sd, 8);
}

TEST(Texture, KnocksAndSpellsAreFoundWhereTheyAre) {
  MadeNoise noise;
  const Texture knock = texture_of([&](const Segment& s, double t) {
    const double ring = s.placement == 7 && t > 5 && t < 5.5 ? 0.03 * std::exp(-(t - 5) / 0.1) : 0;
    return Eigen::Vector3d(s.rotation.col(2) + noise() +
                           Eigen::Vector3d::Constant(ring * std::cos(2 * M_PI * 20 * t)));
  });
  EXPECT_GT(worst_of(knock).loudest, 6);
  EXPECT_EQ(knock.scales.back().loudest_segment, 7U);
  const Texture spells = texture_of([&](const Segment& s, double) {
    return Eigen::Vector3d(s.rotation.col(2) + (s.placement % 3 == 0 ? 1.3 : 1.0) * noise());
  });
  EXPECT_GT(worst_of(spells).dwells, 6);
}

}  // namespace
}  // namespace sixpoint::gap
