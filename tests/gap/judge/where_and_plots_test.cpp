#include <random>

#include <gtest/gtest.h>

#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

// White noise of s mg at 100 Hz: the Allan deviation of means of tau seconds is s / sqrt(100 tau).
TEST(MakePlots, AllanDeviationOfWhiteNoise) {
  Bundle bundle;
  Segment still;
  still.samples = 60'000;
  bundle.segments = {still};
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 8);
  for (std::size_t i = 0; i < still.samples; ++i) {
    const auto value = [&] { return static_cast<std::int16_t>(std::lround(normal(random))); };
    bundle.samples.push_back({value(), value(), value()});
  }
  const DiagnoseOptions options;
  Records records;
  records.clean.samples = bundle.samples;
  records.clean.flags.assign(still.samples, kSampleGood);
  const Plots plots = make_plots({bundle, options}, records, {}, {});
  const double noise_mg = std::sqrt(64 + 1.0 / 12) * 1000 / 256;  // rounding included
  ASSERT_GE(plots.allan_s.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(plots.allan_mg[1][i] / (noise_mg / std::sqrt(100 * plots.allan_s[i])), 1, 0.15);
  }
}

}  // namespace
}  // namespace sixpoint::gap
