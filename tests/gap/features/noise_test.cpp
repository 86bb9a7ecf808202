#include "gap/features/noise.h"

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

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

// Counts of Gaussian noise of `sd` LSB about `mean`, one dwell, the axes alike.
Bundle counts_about(double mean, const std::function<int(int)>& stored, double sd = 1.5,
                    std::size_t samples = 1000, unsigned seed = 21) {
  Bundle bundle;
  Segment segment;
  segment.samples = samples;
  segment.settled = true;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(mean, sd);
  for (std::size_t n = 0; n < segment.samples; ++n) {
    gt3x::Counts counts;
    for (std::int16_t& x : counts) {
      x = static_cast<std::int16_t>(stored(static_cast<int>(std::lround(normal(random)))));
    }
    bundle.samples.push_back(counts);
  }
  bundle.segments.push_back(segment);
  return bundle;
}

// Truncated toward zero, a dwell about zero has less noise than there is; it does not count where
// others tell.
TEST(Noise, DwellsAboutZeroDoNotHideTheNoiseOfTruncatedNumbers) {
  const auto truncated = [](double mean, unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(mean, 1);
    std::vector<gt3x::Counts> samples(6000);
    for (gt3x::Counts& counts : samples) {
      for (std::int16_t& x : counts) {
        x = static_cast<std::int16_t>(normal(random));
      }
    }
    return samples;
  };
  Bundle bundle;
  for (const double mean : {0.0, 0.2, 100.3}) {
    Segment segment;
    segment.settled = true;
    segment.first_sample = bundle.samples.size();
    for (const gt3x::Counts& counts : truncated(mean, 5)) {
      bundle.samples.push_back(counts);
    }
    segment.samples = bundle.samples.size() - segment.first_sample;
    segment.pose = static_cast<int>(bundle.segments.size());
    bundle.segments.push_back(segment);
  }
  const NoiseSpectrum noise = noise_spectrum(bundle, clean_samples(bundle));
  ASSERT_TRUE(noise.usable());
  EXPECT_NEAR(noise.white_mg[1], std::hypot(1, std::sqrt(1 / 12.0)) * 1000 / 256, 0.25);
}

TEST(Noise, OddAndEvenCodesAreAlikeUnlessABitIsStuck) {
  const Bundle plain = counts_about(100.3, [](int x) { return x; });
  const CodeStatistics codes = code_statistics(plain, clean_samples(plain));
  EXPECT_EQ(codes.samples, 1000U);  // two pieces of five seconds
  // Half of 1000, sd sqrt(1000 / 4).
  EXPECT_NEAR(codes.odd_share[0], 0.5, 5 * std::sqrt(0.25 / 1000));
  const Bundle stuck = counts_about(100.3, [](int x) { return x & ~1; });
  EXPECT_EQ(code_statistics(stuck, clean_samples(stuck)).odd_share[1], 0);
}

// Oracle: the noise is Gaussian before it is rounded. At 0.75 LSB the grid of counts does not show
// in 100,000 samples; at 0.45 LSB it does, so that the form of the noise cannot be judged.
TEST(Noise, TheGridOfCountsIsNotTakenForTheNoisesForm) {
  const auto kurtosis_sd = [](double sd) {
    const Bundle bundle = counts_about(
        100.5, [](int x) { return x; }, sd, 100'000);
    return code_statistics(bundle, clean_samples(bundle)).kurtosis_sd;
  };
  EXPECT_NE(kurtosis_sd(0.75), 0);
  EXPECT_LT(std::abs(kurtosis_sd(0.75)), 4);
  EXPECT_EQ(kurtosis_sd(0.45), 0);
}

// At 20 Hz the noise is 0.45 LSB: rounding makes its variance 0.27 where the mean lies on a count
// and 0.30 where it lies between two, in the same noise.
TEST(Noise, TheGridOfCountsIsNotTakenForNoiseThatChanges) {
  const auto spread_sd = [](double sd_of_every_second) {
    Bundle all;
    for (int i = 0; i < 40; ++i) {
      const bool second = i % 2 == 1;
      Bundle dwell = counts_about(
          second ? 100.5 : 100, [](int x) { return x; }, second ? sd_of_every_second : 0.45, 1000,
          static_cast<unsigned>(i));
      dwell.segments.front().first_sample = all.samples.size();
      all.segments.push_back(dwell.segments.front());
      all.samples.insert(all.samples.end(), dwell.samples.begin(), dwell.samples.end());
    }
    return code_statistics(all, clean_samples(all)).spread_sd;
  };
  EXPECT_LT(spread_sd(0.45), 3);
  EXPECT_GT(spread_sd(0.6), 10);
}

TEST(Noise, AnOutlierIsCounted) {
  Bundle bundle = counts_about(100.3, [](int x) { return x; });
  bundle.samples[250][2] = 130;  // 20 sd
  EXPECT_EQ(code_statistics(bundle, clean_samples(bundle)).outliers, 1U);
}

TEST(Noise, VarianceAtIsTheMedianOfNineBins) {
  NoiseSpectrum spectrum;
  for (int k = 0; k < 20; ++k) {
    spectrum.frequency_hz.push_back(1.5 + 0.5 * k);
    spectrum.variance_mg2[0].push_back(k == 7 ? 1000 : 16);  // one line
  }
  EXPECT_EQ(spectrum.variance_at(0, 5), 16);  // the line's own bin
}

}  // namespace
}  // namespace sixpoint::gap
