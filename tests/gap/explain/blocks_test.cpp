#include "gap/explain/blocks.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "gap/made_bundle.h"

namespace sixpoint::gap {
namespace {

std::vector<Block> blocks_of(const Bundle& bundle, const CleanSamples& clean) {
  return make_blocks(bundle, clean, noise_spectrum(bundle, clean), {}, {});
}

// The first second after a move is left out: nine seconds of 100 samples remain.
TEST(Blocks, DwellsHaveTheMeanOfTheirSamples) {
  const tests::MadeUnit unit;
  const Bundle bundle = tests::made_production(unit);
  const CleanSamples clean = clean_samples(bundle);
  const std::vector<Block> blocks = blocks_of(bundle, clean);
  ASSERT_EQ(blocks.size(), 18U);
  for (const Block& block : blocks) {
    const Segment& segment = bundle.segments[block.segment];
    EXPECT_NEAR(block.seconds, 9, 1e-9);
    EXPECT_NEAR(block.middle_s, segment.host_start_s + 5.495, 1e-9);
    EXPECT_NEAR(block.temperature_c, 23, 1e-9);
    for (Eigen::Index a = 0; a < 3; ++a) {
      const double expected_mg = 1000 * (segment.rotation(a, 2) * unit.gain[a] + unit.offset_g[a]);
      EXPECT_NEAR(block.value_mg[a], expected_mg, 1.5);
      // Noise and rounding of one sample over 900.
      const double sample_mg = std::hypot(1000 * unit.noise_g[a], 1000 / 256.0 / std::sqrt(12));
      EXPECT_NEAR(std::sqrt(block.white_mg2(a, a)), sample_mg / 30, 0.02);
    }
  }
  EXPECT_EQ(blocks[5].session, 0);
  EXPECT_EQ(blocks[6].session, 1);
}

// Of noise of 4 LSB, of which each sample is the mean of two neighbours: its density at low frequencies is
// that of 4 LSB, and a sample scatters by 4 / sqrt(2).
TEST(Blocks, TheNoiseOfASampleIsThatBehindTheFilter) {
  Bundle bundle = tests::made_production({});
  std::mt19937_64 random(9);
  std::normal_distribution<double> noise_lsb(0, 4);
  double before = 0;
  for (gt3x::Counts& counts : bundle.samples) {
    const double now = noise_lsb(random);
    for (std::int16_t& count : counts) {
      count = static_cast<std::int16_t>(std::lround(count + (before + now) / 2));
    }
    before = now;
  }
  const CleanSamples clean = clean_samples(bundle);
  const std::vector<Block> blocks = blocks_of(bundle, clean);
  const double lsb_mg = 1000 / 256.0;
  for (Eigen::Index a = 0; a < 3; ++a) {
    // Beside it the unit's own noise, and the first rounding.
    const double own_mg = std::hypot(1000 * tests::MadeUnit().noise_g[a], lsb_mg / std::sqrt(12));
    EXPECT_NEAR(blocks[0].noise_mg[a], std::hypot(own_mg, 4 / M_SQRT2 * lsb_mg), 0.3);
  }
}

TEST(Blocks, MaskedSamplesAreLeftOut) {
  const Bundle bundle = tests::made_production({});
  CleanSamples clean = clean_samples(bundle);
  for (std::size_t i = 0; i < 400; ++i) {
    clean.flags[2000 + 100 + i] = kSampleHeld;
    clean.samples[2000 + 100 + i] = {2000, 2000, 2000};
  }
  for (std::size_t i = 0; i < 750; ++i) {
    clean.flags[3000 + 100 + i] = kSampleZero;
  }
  const std::vector<Block> blocks = blocks_of(bundle, clean);
  ASSERT_EQ(blocks.size(), 17U) << "1.5 s of the fourth dwell are too few";
  EXPECT_NEAR(blocks[2].seconds, 5, 1e-9);
  EXPECT_LT(blocks[2].value_mg.cwiseAbs().maxCoeff(), 1100);
  EXPECT_EQ(blocks[3].segment, 4U);
}

TEST(Blocks, LongRecordsAreCutIntoPiecesOfTwoMinutes) {
  Bundle bundle = tests::made_production({});
  Segment& last = bundle.segments.back();
  const std::size_t more = 26'000;
  last.samples += more;  // 270 s
  bundle.samples.insert(bundle.samples.end(), more, bundle.samples.back());
  CleanSamples clean = clean_samples(tests::made_production({}));
  clean.samples = bundle.samples;
  clean.flags.assign(bundle.samples.size(), kSampleGood);
  const std::vector<Block> blocks = blocks_of(bundle, clean);
  // 1 to 121 s, 121 to 241 s; the 29 s that are left are less than a quarter of a piece.
  ASSERT_EQ(blocks.size(), 19U);
  EXPECT_NEAR(blocks[17].seconds, 120, 1e-9);
  EXPECT_NEAR(blocks[18].seconds, 149, 1e-9);
  EXPECT_EQ(blocks[18].placement, blocks[17].placement);
}

// A day at 10 Hz has 500 pieces and no more: the work of an explanation grows with their cube.
TEST(Blocks, ADayIsCutIntoFiveHundredPieces) {
  Bundle bundle = tests::made_production({});
  bundle.rate_hz = 10;
  const std::size_t more = 864'000 - bundle.samples.size();
  bundle.segments.back().samples += more;
  bundle.samples.insert(bundle.samples.end(), more, bundle.samples.back());
  CleanSamples clean;
  clean.samples = bundle.samples;
  clean.flags.assign(bundle.samples.size(), kSampleGood);
  const std::vector<Block> blocks = blocks_of(bundle, clean);
  EXPECT_GT(blocks.size(), 500U);
  EXPECT_LT(blocks.size(), 520U);
  EXPECT_NEAR(blocks.back().seconds, 172.8, 0.25 * 172.8);
}

}  // namespace
}  // namespace sixpoint::gap
