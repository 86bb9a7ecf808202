#include "calib/still_blocks.h"

#include <gtest/gtest.h>

#include "expect_result.h"
#include "synthetic_unit.h"

namespace sixpoint::calib {
namespace {

using tests::Sample;
using tests::SyntheticUnit;
using tests::Vector;

Reversal reversal_of(const SyntheticUnit& unit) {
  return *Reversal::make({unit.positive, unit.negative, unit.zero}, unit.accel_scale,
                         RecordWidth::bits12);
}

std::size_t blocks_in(const std::vector<Sample>& samples, double rate_hz,
                      const StillBlockOptions& options = {}) {
  const Reversal reversal = reversal_of({});
  auto finder = *StillBlockFinder::make(reversal, rate_hz, options);
  finder.push(0, samples);
  finder.break_run();
  return finder.blocks().size();
}

struct Rest {
  SyntheticUnit unit;
  std::vector<Sample> samples;
  Reversal reversal;
};
// A unit that lies on its back.
Rest rest_of(double noise_mg, double seconds, double rate_hz, unsigned seed) {
  std::mt19937_64 random(seed);
  SyntheticUnit unit;
  unit.noise_mg = noise_mg;
  return {unit, tests::at_rest(unit, {0, 0, 1}, seconds, rate_hz, random), reversal_of(unit)};
}

// Stored counts straight: value per sample and axis.
std::vector<Sample> line(int count, double start, double step, std::int16_t others = 100) {
  std::vector<Sample> samples;
  for (int i = 0; i < count; ++i) {
    samples.push_back({static_cast<std::int16_t>(std::lround(start + step * i)), others, others});
  }
  return samples;
}

TEST(StillBlocks, FindsThemAtEveryRate) {
  std::mt19937_64 random(1);
  for (const double rate : {30.0, 32.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0}) {
    SyntheticUnit unit;
    unit.noise_mg = 3;
    const auto samples = tests::at_rest(unit, tests::unit_vector(0.1, 0.2, 1), 60, rate, random);
    const Reversal reversal = reversal_of(unit);
    auto finder = *StillBlockFinder::make(reversal, rate);
    finder.push(1000, samples);
    EXPECT_GE(finder.blocks().size(), 14U) << rate;
    EXPECT_LE(finder.blocks().size(), 15U) << rate;
    for (std::size_t i = 1; i < finder.blocks().size(); ++i) {
      EXPECT_GE(finder.blocks()[i].start_time_s, finder.blocks()[i - 1].start_time_s + 4 - 1e-9);
    }
  }
}

// Oracle: what the generator put in. Standard error of a block mean is 4 mg / sqrt(120) = 0.37 mg.
TEST(StillBlocks, MeansAreTheRecoveredRawCounts) {
  std::mt19937_64 random(2);
  const SyntheticUnit unit;
  const Vector up = tests::unit_vector(0.6, -0.5, 0.62);
  const Reversal reversal = reversal_of(unit);
  auto finder = *StillBlockFinder::make(reversal, 30);
  finder.push(0, tests::at_rest(unit, up, 400, 30, random));
  ASSERT_GT(finder.blocks().size(), 90U);
  Vector mean{};
  for (const StillBlock& block : finder.blocks()) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      mean[a] += block.mean_lsb[a] / static_cast<double>(finder.blocks().size());
      EXPECT_NEAR(block.sd_lsb[a] / unit.counts_per_g[a], 0.004, 0.0012);
    }
  }
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_NEAR((mean[a] - unit.zero_counts[a]) / unit.counts_per_g[a], up[a], 0.00025) << a;
  }
}

// The slope criterion's edge, in the file's own g: 0.0005 g per sample is 0.128 counts.
TEST(StillBlocks, SlopeCriterion) {
  EXPECT_EQ(blocks_in(line(120, 0, 0.120), 30), 1U);
  EXPECT_EQ(blocks_in(line(120, 0, -0.120), 30), 1U);
  EXPECT_EQ(blocks_in(line(120, 0, 0.136), 30), 0U);
  EXPECT_EQ(blocks_in(line(120, 0, -0.136), 30), 0U);
}

// The residual criterion's edge: 0.015 g is 3.84 counts.
TEST(StillBlocks, ResidualCriterion) {
  auto samples = line(120, 200, 0);
  samples[60][1] = static_cast<std::int16_t>(samples[60][1] + 3);
  EXPECT_EQ(blocks_in(samples, 30), 1U);
  samples[60][1] = static_cast<std::int16_t>(samples[60][1] + 2);
  EXPECT_EQ(blocks_in(samples, 30), 0U);
}

TEST(StillBlocks, ChargingAndZeros) {
  EXPECT_EQ(blocks_in(std::vector<Sample>(300, Sample{0, 0, 0}), 30), 0U);
  auto one = line(120, 200, 0);
  one[7] = {0, 0, 0};
  EXPECT_EQ(blocks_in(one, 30), 0U);
  // A level axis at exactly zero is good data, except by the letter of the formula.
  const auto level = line(120, 200, 0, 0);
  EXPECT_EQ(blocks_in(level, 30), 1U);
  EXPECT_EQ(blocks_in(level, 30, {.strict_nonzero = true}), 0U);
}

TEST(StillBlocks, ClippedIsUnusable) {
  const Reversal reversal = reversal_of({});
  auto finder = *StillBlockFinder::make(reversal, 30);
  finder.push(0, line(200, 2047, 0));
  EXPECT_EQ(finder.blocks().size(), 0U);
  EXPECT_GT(finder.tally().rejected_clipped, 0U);
}

TEST(StillBlocks, NeverSpanAGapAndDoNotDependOnHowTheyArrive) {
  const auto [unit, samples, reversal] = rest_of(3, 301, 30, 3);
  auto whole = *StillBlockFinder::make(reversal, 30);
  whole.push(5, samples);
  auto pieces = *StillBlockFinder::make(reversal, 30);
  for (std::size_t i = 0; i < samples.size(); i += 30) {
    pieces.push(5 + static_cast<double>(i) / 30,
                std::span(samples).subspan(i, std::min<std::size_t>(30, samples.size() - i)));
  }
  ASSERT_EQ(whole.blocks().size(), pieces.blocks().size());
  for (std::size_t i = 0; i < whole.blocks().size(); ++i) {
    EXPECT_NEAR(whole.blocks()[i].start_time_s, pieces.blocks()[i].start_time_s, 1e-6);
    EXPECT_EQ(whole.blocks()[i].first_sample, pieces.blocks()[i].first_sample);
    EXPECT_EQ(whole.blocks()[i].mean_lsb, pieces.blocks()[i].mean_lsb);
  }
  // Runs of 3.9 s never hold a block; runs of 4 s hold one each.
  for (const auto& [length, expected] : {std::pair<std::size_t, std::size_t>{117, 0}, {120, 50}}) {
    auto finder = *StillBlockFinder::make(reversal, 30);
    for (std::size_t i = 0; i < 50; ++i) {
      finder.push(static_cast<double>(10 * i), line(static_cast<int>(length), 200, 0));
      finder.break_run();
    }
    EXPECT_EQ(finder.blocks().size(), expected);
    EXPECT_EQ(finder.tally().runs, 50U);
  }
}

// The paper's criteria to the letter, sample by sample, for every window that the search looks at:
// where it finds a block. Shares no code with the finder.
std::vector<std::size_t> starts_by_the_letter(const std::vector<Sample>& samples, int block,
                                              int step) {
  std::vector<std::size_t> starts;
  const auto size = static_cast<std::size_t>(block);
  for (std::size_t begin = 0; begin + size <= samples.size();) {
    bool still = true;
    bool all_zero = false;
    bool clipped = false;
    for (std::size_t a = 0; a < kAxes; ++a) {
      long double sum_t = 0, sum_v = 0, sum_tt = 0, sum_tv = 0;
      for (std::size_t i = 0; i < size; ++i) {
        const long double value = samples[begin + i][a];
        const auto time = static_cast<long double>(i);
        sum_t += time, sum_v += value, sum_tt += time * time, sum_tv += time * value;
      }
      const long double slope = (block * sum_tv - sum_t * sum_v) / (block * sum_tt - sum_t * sum_t);
      const long double start = (sum_v - slope * sum_t) / block;
      still = still && std::abs(slope) / 256 < 0.0005L;
      for (std::size_t i = 0; i < size; ++i) {
        const long double value = samples[begin + i][a];
        still =
            still && std::abs(value - start - slope * static_cast<long double>(i)) / 256 < 0.015L;
        clipped = clipped || value <= -2048 || value >= 2047;
      }
    }
    for (std::size_t i = 0; i < size; ++i) {
      all_zero = all_zero || samples[begin + i] == Sample{0, 0, 0};
    }
    still = still && !all_zero && !clipped;
    if (still) {
      starts.push_back(begin);
    }
    begin += still ? size : static_cast<std::size_t>(step);
  }
  return starts;
}

// Rest, slow turns, steps, zeros, the sensor's limit and movement, in stretches of random length.
std::vector<Sample> mixed_recording(unsigned seed, double rate_hz) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> noise(0, 1);
  std::vector<Sample> samples;
  while (samples.size() < static_cast<std::size_t>(600 * rate_hz)) {
    const int kind = static_cast<int>(unit(random) * 8);
    const auto count = static_cast<std::size_t>((1 + 20 * unit(random)) * rate_hz);
    std::array<double, 3> level{};
    std::array<double, 3> turn{};
    for (std::size_t a = 0; a < kAxes; ++a) {
      level[a] = kind == 6 ? 0 : 500 * (unit(random) - 0.5) + (kind == 7 && a == 0 ? 2040 : 0);
      turn[a] = kind == 1 ? 0.3 * (unit(random) - 0.5) : 0;
    }
    const double sd = kind == 2 ? 30 : kind == 3 ? 2 : kind == 6 ? 0.2 : 0.7;
    for (std::size_t i = 0; i < count; ++i) {
      Sample sample{};
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double step = kind == 4 && i > count / 2 ? 5 : 0;
        const double value =
            level[a] + turn[a] * static_cast<double>(i) + step + sd * noise(random);
        sample[a] = static_cast<std::int16_t>(std::lround(std::clamp(value, -2048.0, 2047.0)));
      }
      samples.push_back(sample);
    }
  }
  return samples;
}

TEST(StillBlocks, AreThoseOfThePapersLetter) {
  std::size_t found = 0;
  for (const double rate_hz :
       {25.0, 30.0, 100.0}) {  // at 25 Hz a block is no whole number of steps
    // Neighbouring counts that are unevenly many raw counts apart, and some that none leads to.
    SyntheticUnit unit;
    unit.positive[0] = unit.positive[0] * 11 / 10;
    unit.positive[1] = unit.positive[1] * 9 / 10;
    const Reversal reversal = reversal_of(unit);
    const int block = static_cast<int>(4 * rate_hz);
    const int step = static_cast<int>(std::lround(0.5 * rate_hz));
    for (unsigned seed = 1; seed <= 6; ++seed) {
      const auto samples = mixed_recording(seed, rate_hz);
      const auto starts = starts_by_the_letter(samples, block, step);
      auto finder = *StillBlockFinder::make(reversal, rate_hz, {.noisy_sd_g = 0});
      for (std::size_t i = 0; i < samples.size(); i += 37) {
        finder.push(static_cast<double>(i) / rate_hz,
                    std::span(samples).subspan(i, std::min<std::size_t>(37, samples.size() - i)));
      }
      ASSERT_EQ(finder.blocks().size(), starts.size()) << rate_hz << " Hz, seed " << seed;
      for (std::size_t i = 0; i < starts.size(); ++i) {
        EXPECT_NEAR(finder.blocks()[i].start_time_s * rate_hz, static_cast<double>(starts[i]),
                    1e-6);
        for (std::size_t a = 0; a < kAxes; ++a) {
          double sum = 0;
          for (int k = 0; k < block; ++k) {
            sum += reversal.raw_lsb(a, samples[starts[i] + static_cast<std::size_t>(k)][a]);
          }
          EXPECT_NEAR(finder.blocks()[i].mean_lsb[a], sum / block, 1e-9);
        }
      }
      found += starts.size();
    }
  }
  EXPECT_GT(found, 200U);
}

TEST(StillBlocks, NoiseAloneIsKeptApartAndMarked) {
  const auto [unit, samples, reversal] = rest_of(5.5, 60, 100, 4);
  auto paper = *StillBlockFinder::make(reversal, 100, {.noisy_sd_g = 0});
  paper.push(0, samples);
  auto tolerant = *StillBlockFinder::make(reversal, 100);
  tolerant.push(0, samples);
  EXPECT_LE(paper.blocks().size(), 3U);
  EXPECT_GE(tolerant.blocks().size(), 13U);
  EXPECT_EQ(tolerant.tally().noisy_blocks + paper.tally().blocks, tolerant.tally().blocks);
  // Movement of the same size that is no noise stays out: a nudge of 20 mg in a quiet block.
  auto nudged = line(120, 200, 0);
  nudged[50][0] = static_cast<std::int16_t>(nudged[50][0] + 5);
  EXPECT_EQ(blocks_in(nudged, 30), 0U);
}

TEST(StillBlocks, MemoryIsBounded) {
  EXPECT_LE(blocks_in(line(120 * 300, 200, 0), 30, {.max_blocks = 64}), 64U);
  EXPECT_GE(blocks_in(line(120 * 300, 200, 0), 30, {.max_blocks = 64}), 32U);
}

TEST(StillBlocks, NonsenseOptions) {
  const Reversal reversal = reversal_of({});
  for (const double rate : {0.0, -30.0, 1e6, std::nan("")}) {
    EXPECT_FAILS(StillBlockFinder::make(reversal, rate), ErrorCode::bad_data);
  }
  EXPECT_FAILS(StillBlockFinder::make(reversal, 30, {.block_s = -1}), ErrorCode::usage);
  EXPECT_FAILS(StillBlockFinder::make(reversal, 30, {.max_residual_g = std::nan("")}),
               ErrorCode::usage);
}

}  // namespace
}  // namespace sixpoint::calib
