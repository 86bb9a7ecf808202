#include "gap/features/texture.h"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

// Gaussian noise on top of the pose.
struct MadeNoise {
  explicit MadeNoise(double sd_g = 0.0039) : normal(0, sd_g) {}
  std::mt19937_64 random{11};
  std::normal_distribution<double> normal;
  Eigen::Vector3d operator()() { return {normal(random), normal(random), normal(random)}; }
};

Texture texture_of(const tests::MadeForce& force) {
  tests::MadeUnit unit;
  unit.noise_g.setConstant(1e-6);
  const Bundle bundle = tests::made_production(unit, force);
  return noise_texture(bundle, clean_samples(bundle));
}

struct Worst {
  double tails = 0, dwells = 0, moments = 0, loudest = 0, after_moves = 0;
};
Worst worst_of(const Texture& texture) {
  Worst worst;
  for (const Texture::Scale& scale : texture.scales) {
    worst.tails = std::max(worst.tails, std::abs(scale.tails_sd));
    worst.dwells = std::max(worst.dwells, scale.dwells_sd);
    worst.moments = std::max(worst.moments, scale.moments_sd);
    worst.loudest = std::max(worst.loudest, scale.loudest_sd);
    worst.after_moves = std::max(worst.after_moves, scale.after_moves_sd);
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
  EXPECT_LT(worst.after_moves, 4.5);
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

// What follows a move and is no share of its step: 20 mg at 8 Hz along z, whichever way the unit was
// turned (a foreign generator's, which nothing saw). Ringing in proportion to the step is taken off.
TEST(Texture, TheFirstSecondsAfterAMoveAreAsLoudAsTheRest) {
  const auto ringing = [](double t) { return std::exp(-t / 0.4) * std::cos(2 * M_PI * 8 * t); };
  MadeNoise noise;
  const Worst same = worst_of(texture_of([&](const Segment& s, double t) {
    return Eigen::Vector3d(s.rotation.col(2) + 0.02 * ringing(t) * Eigen::Vector3d::UnitZ() +
                           noise());
  }));
  EXPECT_GT(same.after_moves, 10);
  EXPECT_LT(std::max({same.dwells, same.moments, same.loudest}), 4.5) << "the rest is plain";
  const auto by_step = [&](const Segment& s, double t) {
    return Eigen::Vector3d(s.rotation.col(2) + 0.03 * ringing(t) * s.approach_g + noise());
  };
  tests::MadeUnit unit;
  unit.noise_g.setConstant(1e-6);
  const Bundle bundle = tests::made_production(unit, by_step);
  const CleanSamples clean = clean_samples(bundle);
  EXPECT_GT(worst_of(noise_texture(bundle, clean)).after_moves, 10);
  EXPECT_LT(worst_of(noise_texture(bundle, clean, {}, [&](double t) { return 0.03 * ringing(t); }))
                .after_moves,
            4.5);
  EXPECT_LT(worst_of(noise_texture(bundle, clean, {}, {}, 2.5)).after_moves, 4.5);
}

// Two lines are no noise once they are taken off; a spell of louder noise beside them still is one.
TEST(Texture, LinesAreTakenOff) {
  const auto with_lines = [](double louder, const std::vector<double>& lines_hz) {
    MadeNoise noise;
    tests::MadeUnit unit;
    unit.noise_g.setConstant(1e-6);
    const Bundle bundle = tests::made_production(unit, [&](const Segment& s, double t) {
      const double phase = static_cast<double>(s.first_sample);
      const double up = 0.006 * std::sin(2 * M_PI * 11.3 * t + phase) +
                        0.003 * std::sin(2 * M_PI * 22.6 * t + 2 * phase);
      const double share = s.first_sample >= 4000 && s.first_sample < 8000 ? louder : 1;
      return Eigen::Vector3d((1 + up) * s.rotation.col(2) + share * noise());
    });
    return noise_texture(bundle, clean_samples(bundle), lines_hz);
  };
  EXPECT_GT(worst_of(with_lines(1, {})).dwells, 10);
  EXPECT_GT(worst_of(with_lines(1, {11.3})).dwells, 4.5);
  expect_plain(with_lines(1, {11.3, 22.6}));
  EXPECT_GT(worst_of(with_lines(1.25, {11.3, 22.6})).dwells, 8);
}

// A dwell in which the clock slips breaks the phase of a line: it is left out.
TEST(Texture, ASlipBesideALineSaysNothing) {
  MadeNoise noise;
  tests::MadeUnit unit;
  unit.noise_g.setConstant(1e-6);
  const Bundle bundle = tests::made_production(unit, [&](const Segment& s, double t) {
    const double turned = s.first_sample == 3000 && t > 5 ? M_PI : 0;
    return Eigen::Vector3d(
        (1 + 0.006 * std::sin(2 * M_PI * 11.3 * t + turned)) * s.rotation.col(2) + noise());
  });
  CleanSamples clean = clean_samples(bundle);
  EXPECT_GT(worst_of(noise_texture(bundle, clean, {11.3})).loudest, 4.5);
  clean.flags[3550] |= kSampleSlipped;
  expect_plain(noise_texture(bundle, clean, {11.3}));
}

// Noise that passes a mechanism with play: it follows only what goes beyond the play.
Texture texture_with_play(double noise_sd_g, double play_g) {
  MadeNoise noise(noise_sd_g);
  Eigen::Vector3d held = Eigen::Vector3d::Constant(9);
  return texture_of([&](const Segment& s, double) {
    const Eigen::Array3d now = s.rotation.col(2) + noise();
    held = held.cwiseMax((now - play_g).matrix()).cwiseMin((now + play_g).matrix());
    return held;
  });
}

TEST(Texture, WhatIsNoLinearFilterHasTails) {
  EXPECT_GT(texture_with_play(0.0078, 0.004).scales.front().tails_sd, 8);
}

// kFreeOfGrid_lsb2: here the grid of counts gives the noise its form.
TEST(Texture, NoiseBelowTheGridIsNotJudged) {
  EXPECT_EQ(texture_with_play(0.0039, 0.002).scales.front().tails_sd, 0);
}

// A Butterworth filter of order four at an eighth of the rate (by the bilinear transform) leaves
// half a count: neighbours are rounded alike, and the form shows that beyond one sample's scale.
TEST(Texture, WhatIsRoundedAlikeIsNotJudgedByItsForm) {
  MadeNoise noise(0.0041);
  const double k = std::tan(M_PI / 8);
  struct Section {
    double damping;
    Eigen::Vector3d x1 = Eigen::Vector3d::Zero(), x2 = x1, y1 = x1, y2 = x1;
  };
  std::array<Section, 2> sections = {Section{2 * std::cos(M_PI / 8)}, {2 * std::cos(3 * M_PI / 8)}};
  const Texture texture = texture_of([&](const Segment& s, double) {
    Eigen::Vector3d x = noise();
    for (Section& f : sections) {
      const double n = 1 / (1 + k * f.damping + k * k);
      const Eigen::Vector3d y = n * (k * k * (x + 2 * f.x1 + f.x2) - 2 * (k * k - 1) * f.y1 -
                                     (1 - k * f.damping + k * k) * f.y2);
      f.x2 = f.x1;
      f.x1 = x;
      f.y2 = f.y1;
      f.y1 = y;
      x = y;
    }
    return Eigen::Vector3d(s.rotation.col(2) + x);
  });
  for (const Texture::Scale& scale : texture.scales) {
    if (scale.samples > 0 && scale.samples <= 4) {
      EXPECT_EQ(scale.tails_sd, 0) << scale.samples;
    }
  }
  MadeNoise white(0.0041);
  EXPECT_NE(texture_of([&](const Segment& s, double) {
              return Eigen::Vector3d(s.rotation.col(2) + white());
            })
                .scales[2]
                .tails_sd,
            0);
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
