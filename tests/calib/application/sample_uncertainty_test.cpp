#include "calib/application/sample_uncertainty.h"

#include <cmath>
#include <cstdio>
#include <random>

#include <gtest/gtest.h>

#include "calib/scaling.h"
#include "calib/synthetic_unit.h"
#include "expect_result.h"

namespace sixpoint::calib {
namespace {

using tests::SyntheticUnit;
using tests::Vector;

struct Setting {
  const char* name = "";
  double zero_mg = 1;
  double sensitivity_relative = 0.002;
  PerAxis<double> terms_sd{};  // 0 0 0: the six constants alone
  bool affine = false;
  RecordWidth output = RecordWidth::bits12;
  double accel_scale = 256;
  int old_half_span = 250;  // (positive - negative) / 2 in the file: above the scale, pairs occur
};

constexpr PerAxis<double> kTerms = {0.001, 0.0005, 0.0008};
const Setting kSettings[] = {
    {"integers, rounding alone", 0.01, 1e-5, {}, false, RecordWidth::bits12, 256, 250},
    {"integers, 12 bits", 1.5, 0.002, {}, false, RecordWidth::bits12, 256, 250},
    {"integers, 16 bits", 1.5, 0.002, {}, false, RecordWidth::bits16, 256, 250},
    {"integers, pairs", 0.5, 0.001, {}, false, RecordWidth::bits12, 256, 330},
    {"integers, 341 LSB/g", 1, 0.002, {}, false, RecordWidth::bits12, 341, 300},
    {"integers, matrix", 1, 0.001, kTerms, false, RecordWidth::bits12, 256, 250},
    {"affine map", 1, 0.002, {}, true, RecordWidth::bits12, 256, 260},
    {"affine map, matrix, 16 bits", 2, 0.001, kTerms, true, RecordWidth::bits16, 256, 240},
};

// A sensor near nominal. What it feels is known, and so is what the file says after the repair with
// constants that are off by a draw of their own uncertainty.
struct Trial {
  Calibration truth;
  PerAxis<double> truth_terms{};
  Calibration found;
  PerAxis<double> found_terms{};
};

Trial draw(const Setting& setting, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> spread(-1, 1);
  Trial trial;
  const bool has_terms = setting.terms_sd != PerAxis<double>{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    const double s = 0.004 * (1 + 0.03 * spread(random));
    trial.truth.sensitivity_g_per_lsb[a] = s;
    trial.truth.zero_lsb[a] = 40 * spread(random);
    trial.found.sensitivity_g_per_lsb[a] = s * (1 + setting.sensitivity_relative * normal(random));
    trial.found.zero_lsb[a] = trial.truth.zero_lsb[a] + setting.zero_mg / 1000 / s * normal(random);
    if (has_terms) {
      trial.truth_terms[a] = 0.02 * spread(random);
      trial.found_terms[a] = trial.truth_terms[a] + setting.terms_sd[a] * normal(random);
    }
  }
  return trial;
}

// What a sensor reads that feels `g`, where g = (I + C) u: u by fixed-point iteration.
PerAxis<int> raw_of(const Trial& trial, const Vector& g) {
  const auto& [xy, xz, yz] = trial.truth_terms;
  Vector u = g;
  for (int i = 0; i < 30; ++i) {
    u = {g[0] - xy * u[1] - xz * u[2], g[1] - xy * u[0] - yz * u[2], g[2] - xz * u[0] - yz * u[1]};
  }
  PerAxis<int> raw{};
  for (std::size_t a = 0; a < kAxes; ++a) {
    raw[a] = tests::rounded(trial.truth.zero_lsb[a] + u[a] / trial.truth.sensitivity_g_per_lsb[a]);
  }
  return raw;
}

StoredConstants constants_in_file(const Setting& setting) {
  const int half = setting.old_half_span;
  return {{half + 15, half - 3, half + 7}, {15 - half, -3 - half, 7 - half}, {17, -5, 9}};
}

// The share of samples whose true value lies in the 95 % interval, over trials and axes.
double coverage(const Setting& setting, unsigned seed) {
  constexpr int kTrials = 600;
  constexpr int kSamples = 40;
  std::mt19937_64 random(seed);
  const StoredConstants old = constants_in_file(setting);
  const auto reversal = Reversal::make(old, setting.accel_scale, RecordWidth::bits12);
  EXPECT_OK(reversal);
  int inside = 0;
  for (int i = 0; i < kTrials; ++i) {
    const Trial trial = draw(setting, random);
    Rescale::Options options;
    options.output = setting.output;
    options.affine = setting.affine;
    options.cross_axis = trial.found_terms;
    const auto rescale = Rescale::make(*reversal, trial.found, options);
    EXPECT_OK(rescale);
    RepairedBy by;
    by.constants.zero_mg.fill(setting.zero_mg);
    by.constants.sensitivity_relative.fill(setting.sensitivity_relative);
    by.fresh = trial.found;
    by.before = reversal->calibration();
    by.accel_scale_lsb_per_g = setting.accel_scale;
    by.affine = setting.affine;
    by.cross_axis_sd = setting.terms_sd;
    const SampleUncertainty stated = sample_uncertainty(by);
    for (int k = 0; k < kSamples; ++k) {
      const Vector g = tests::random_direction(random);
      SyntheticUnit unit;
      unit.positive = old.positive_lsb;
      unit.negative = old.negative_lsb;
      unit.zero = old.zero_lsb;
      unit.accel_scale = setting.accel_scale;
      const StoredCounts in = tests::stored_sample(unit, raw_of(trial, g));
      StoredCounts out{};
      RescaleTally counts;
      rescale->apply(std::span(&in, 1), std::span(&out, 1), counts);
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double off_mg = 1000 * (out[a] / setting.accel_scale - g[a]);
        inside += std::abs(off_mg) <= 1.96 * stated.mg[a] ? 1 : 0;
      }
    }
  }
  return 100.0 * inside / (3 * kTrials * kSamples);
}

// Oracle: simulation. The tests' own sensor and firmware, and the true acceleration.
TEST(SampleUncertainty, NinetyFivePercentIntervalsHoldTheTruth) {
  unsigned seed = 1;
  for (const Setting& setting : kSettings) {
    const double percent = coverage(setting, seed++);
    std::printf("%-30s %.1f %% of the samples are in the stated 95 %% interval\n", setting.name,
                percent);
    EXPECT_GE(percent, 93) << setting.name;
    EXPECT_LE(percent, 97) << setting.name;
  }
}

// The table of sample_uncertainty.h; oracle: the numbers by hand.
TEST(SampleUncertainty, HowTheFileWasRescaled) {
  RepairedBy by;
  by.fresh.sensitivity_g_per_lsb = {0.004, 0.004, 0.004};
  by.before.sensitivity_g_per_lsb = {1 / 250.0, 1 / 320.0, 1 / 640.0};  // k = 1.024, 0.8, 0.4
  const SampleUncertainty whole = sample_uncertainty(by);
  EXPECT_EQ(whole.recovery_mg[0], 0);
  // Two fifths of the samples share their count with another: 0.4 x 0.25.
  EXPECT_NEAR(whole.recovery_mg[1], 4 * std::sqrt(0.1), 1e-9);
  // Two or three counts, half of the file's counts each: 0.4 x (0.5 x 0.5 + 0.5 x 2).
  EXPECT_NEAR(whole.recovery_mg[2], 4 * std::sqrt(0.5), 1e-9);
  EXPECT_NEAR(whole.rounding_mg, 1000 / 256.0 / std::sqrt(12), 1e-9);
  EXPECT_NEAR(whole.sensor_counts_mg[0], 4 / std::sqrt(12), 1e-9);
  by.affine = true;
  EXPECT_NEAR(sample_uncertainty(by).recovery_mg[1], 4 / 0.8 / std::sqrt(12), 1e-9);
}

TEST(SampleUncertainty, KnownTermsThatAreNotAppliedCount) {
  RepairedBy by;
  by.fresh.sensitivity_g_per_lsb = {0.004, 0.004, 0.004};
  by.before = by.fresh;
  by.cross_axis_ignored = {0.02, 0, 0.006};
  const SampleUncertainty sample = sample_uncertainty(by);
  EXPECT_NEAR(sample.cross_axis_ignored_mg[0], 20 / std::sqrt(3), 1e-9);
  EXPECT_NEAR(sample.cross_axis_ignored_mg[1], std::hypot(20, 6) / std::sqrt(3), 1e-9);
  EXPECT_NEAR(sample.cross_axis_ignored_mg[2], 6 / std::sqrt(3), 1e-9);
  EXPECT_GT(sample.mg[0], sample.cross_axis_ignored_mg[0]);
}

}  // namespace
}  // namespace sixpoint::calib
