#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(DuplicatedSamples, TheRestComesEarlierAndTheCopyIsExact) {
  ProtocolRun run = quiet({at_rest(up(2), 0, 50, 20'000)});
  run.effects = {spec("duplicated_samples", {{"rate", {0.01}}})};
  const auto twice = record_protocol(run);
  ASSERT_OK(twice);
  // 200 of 20,000 repeated, standard deviation 14.
  EXPECT_NEAR(twice->sample_time_s.back() - 50, 199.99 - 2, 0.7);
  run.noise_mg = {5, 5, 5};
  const auto noisy = record_protocol(run);
  int same = 0;
  for (std::size_t i = 1; i < noisy->counts.size(); ++i) {
    const bool repeated = noisy->sample_time_s[i] - noisy->sample_time_s[i - 1] < 1e-6;
    same += repeated ? 1 : 0;
    EXPECT_TRUE(!repeated || noisy->counts[i] == noisy->counts[i - 1]) << i;
  }
  EXPECT_NEAR(same, 200, 70);
}

std::unique_ptr<Effect> repeating(double rate) {
  auto effect = made_effect("duplicated_samples", {{"rate", {rate}}});
  RecordingPlan plan;
  plan.rate_hz = 100;
  effect->on_recording(plan);
  return effect;
}

// Oracle: independent trials of probability p: a share p is repeated, and a share p of those that
// follow a repeated one. Limits of five standard errors.
TEST(DuplicatedSamples, EachSampleIsRepeatedWithTheSameProbability) {
  constexpr double kRate = 0.3;
  constexpr std::size_t kSamples = 20'000;
  SimulatedBlock block = made_block(kSamples);
  repeating(kRate)->on_sampling(block);
  double repeats = 0;
  double after_a_repeat = 0;
  bool before = false;
  for (std::size_t i = 1; i < kSamples; ++i) {
    const double step_s = block.time_s[i] - block.time_s[i - 1];
    const bool repeated = step_s < 0.005;
    EXPECT_NEAR(step_s, repeated ? 0 : 0.01, 1e-9) << i;
    repeats += repeated ? 1 : 0;
    after_a_repeat += repeated && before ? 1 : 0;
    before = repeated;
  }
  const double sd = std::sqrt(kRate * (1 - kRate));
  EXPECT_NEAR(repeats / kSamples, kRate, 5 * sd / std::sqrt(kSamples));
  EXPECT_NEAR(after_a_repeat / repeats, kRate, 5 * sd / std::sqrt(repeats));
}

// Oracle: the definition, sample by sample: what is stored at a time that came before is what was
// stored before. Blocks are cut where they like, as the simulator cuts them at a placement.
TEST(DuplicatedSamples, TheCopyIsExactHoweverItIsCut) {
  constexpr std::size_t kSamples = 900;
  const auto effect = repeating(0.3);
  SimulatedBlock times = made_block(kSamples);
  const std::vector<gt3x::Counts> read = times.stored;
  effect->on_sampling(times);
  std::vector<gt3x::Counts> stored;
  for (const std::size_t first : {0U, 300U, 600U}) {
    SimulatedBlock part = made_block(300);
    part.first_sample = first;
    part.stored.assign(read.begin() + static_cast<std::ptrdiff_t>(first),
                       read.begin() + static_cast<std::ptrdiff_t>(first) + 300);
    effect->on_firmware(part);
    stored.insert(stored.end(), part.stored.begin(), part.stored.end());
  }
  EXPECT_EQ(stored[0], read[0]);
  for (std::size_t i = 1; i < kSamples; ++i) {
    const bool repeated = times.time_s[i] - times.time_s[i - 1] < 0.005;
    EXPECT_EQ(stored[i], repeated ? stored[i - 1] : read[i]) << i;
  }
}

}  // namespace
}  // namespace sixpoint::sim
