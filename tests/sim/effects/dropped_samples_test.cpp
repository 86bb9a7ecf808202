#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(DroppedSamples, TheRestComesLater) {
  ProtocolRun run = quiet({at_rest(up(2), 0, 50, 20'000)});
  run.noise_mg = {5, 5, 5};
  run.effects = {spec("dropped_samples", {{"rate", {0.01}}})};
  EXPECT_NEAR(record_protocol(run)->sample_time_s.back() - 50, 199.99 + 2.02, 0.7);
}

// Oracle: the geometric law. Where each sample is lost with probability p, k are lost before a
// stored one with probability (1 - p) p^k. Limits of five standard errors.
TEST(DroppedSamples, EachSampleIsLostWithTheSameProbability) {
  constexpr double kRate = 0.3;
  constexpr std::size_t kSamples = 20'000;
  const auto effect = made_effect("dropped_samples", {{"rate", {kRate}}});
  RecordingPlan plan;
  plan.rate_hz = 100;
  effect->on_recording(plan);
  SimulatedBlock block = made_block(kSamples);
  effect->on_sampling(block);
  std::vector<double> seen(4);
  double before_s = -0.01;
  for (const double time_s : block.time_s) {
    const double intervals = (time_s - before_s) * 100;
    EXPECT_NEAR(intervals, std::round(intervals), 1e-6) << "whole intervals are missing";
    const auto lost = static_cast<std::size_t>(std::lround(intervals)) - 1;
    if (lost < seen.size()) {
      seen[lost] += 1.0 / kSamples;
    }
    before_s = time_s;
  }
  for (std::size_t lost = 0; lost < seen.size(); ++lost) {
    const double expected = (1 - kRate) * std::pow(kRate, static_cast<double>(lost));
    EXPECT_NEAR(seen[lost], expected, 5 * std::sqrt(expected * (1 - expected) / kSamples)) << lost;
  }
}

TEST(DroppedSamples, ANewStartOfTheSampleClockMakesUpForTheLoss) {
  const auto effect = made_effect("dropped_samples", {{"rate", {0.01}}});
  RecordingPlan plan;
  plan.rate_hz = 100;
  effect->on_recording(plan);
  SimulatedBlock first = made_block(5000);
  effect->on_sampling(first);
  EXPECT_GT(first.time_s.back(), 49.99 + 0.2);  // about 50 lost
  SimulatedBlock second = made_block(5000, 100, 1000);
  effect->on_sampling(second);
  EXPECT_NEAR(second.time_s.front(), 1000, 0.05);
}

TEST(DroppedSamples, NoneAreLostAtARateOfZero) {
  const auto effect = made_effect("dropped_samples", {{"rate", {0}}});
  effect->on_recording({});
  SimulatedBlock block = made_block(1000);
  const std::vector<double> nominal_s = block.time_s;
  effect->on_sampling(block);
  EXPECT_EQ(block.time_s, nominal_s);
}

}  // namespace
}  // namespace sixpoint::sim
