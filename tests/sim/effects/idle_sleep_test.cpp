#include <algorithm>
#include <cstdint>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"
#include "sim/standard_protocol.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

TEST(IdleSleep, IdleSleepHoldsAtRestOnly) {
  ProtocolRun run;
  run.segments = draw_protocol(StandardProtocol::engineering, 3);
  run.effects = {spec("idle_sleep", {{"fraction", {0.05}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  std::uint64_t held = 0;
  for (const ProtocolSegment& segment : run.segments) {
    std::uint64_t here = 0;
    for (std::uint64_t i = segment.first_sample + 4; i < segment.first_sample + segment.samples;
         ++i) {
      here += (*counts)[i] == (*counts)[i - 1] && (*counts)[i] == (*counts)[i - 2] &&
                      (*counts)[i] == (*counts)[i - 3] && (*counts)[i] == (*counts)[i - 4]
                  ? 1
                  : 0;
    }
    EXPECT_TRUE(!segment.vibration || here < 5) << segment.name;
    held += here;
  }
  EXPECT_NEAR(static_cast<double>(held) / static_cast<double>(counts->size()), 0.05, 0.003);
}

// Oracle: the catalogue's definition: runs of whole seconds that hold the last value, within a
// rest. A fifth of five minutes at 100 Hz is 6000 samples.
TEST(IdleSleep, HoldsTheLastValueForWholeSecondsWithinARest) {
  const RecordingPlan::Stretch rests[] = {{2000, 8000}, {15'000, 10'000}};
  const auto effect = made_effect("idle_sleep", {{"fraction", {0.2}}});
  RecordingPlan plan;
  plan.rate_hz = 100;
  plan.samples = 30'000;
  plan.rests.assign(std::begin(rests), std::end(rests));
  effect->on_recording(plan);
  SimulatedBlock block = made_block(30'000);
  const std::vector<gt3x::Counts> read = block.stored;
  effect->on_firmware(block);
  std::size_t held = 0;
  for (std::size_t i = 0; i < block.size(); ++i) {
    if (block.stored[i] == read[i]) {
      continue;
    }
    held += 1;
    EXPECT_EQ(block.stored[i], block.stored[i - 1]) << i;
    const bool first = block.stored[i - 1] == read[i - 1];
    const bool last = i + 1 == block.size() || block.stored[i + 1] == read[i + 1];
    EXPECT_TRUE(!first || i % 100 == 0) << i;
    EXPECT_TRUE(!last || i % 100 == 99) << i;
    bool at_rest = false;
    for (const auto& rest : rests) {
      at_rest = at_rest || (i > rest.first_sample && i < rest.first_sample + rest.samples);
    }
    EXPECT_TRUE(at_rest) << i;
  }
  EXPECT_EQ(held, 6000U);
}

// Where it has no room it is refused, and not left out in silence. The table of draw_runs().
TEST(IdleSleep, WithoutRoomIsRefused) {
  struct Case {
    std::uint64_t rests, samples;  // of each rest
    double fraction;
    bool fits;
  };
  // Of a rest of n seconds the first sample is the one that is held: n - 1 whole seconds are left.
  for (const Case& c :
       {Case{100, 100, 0.05, false}, Case{100, 200, 0.05, true}, Case{100, 200, 0.6, true},
        Case{1, 20'000, 0.05, true}, Case{1, 20'000, 0.001, true}, Case{1, 20'000, 1, true},
        Case{3, 90, 0, true}}) {
    SCOPED_TRACE(testing::Message() << c.rests << " of " << c.samples << ", " << c.fraction);
    const auto effect = made_effect("idle_sleep", {{"fraction", {c.fraction}}});
    RecordingPlan plan;
    plan.rate_hz = 100;
    plan.samples = c.rests * c.samples;
    for (std::uint64_t i = 0; i < c.rests; ++i) {
      plan.rests.push_back({i * c.samples, c.samples});
    }
    effect->on_recording(plan);
    if (!c.fits) {
      EXPECT_FAILS(effect->problem(), ErrorCode::configuration);
      EXPECT_NE(effect->problem().error().what.find("idle_sleep"), std::string::npos);
      EXPECT_FALSE(effect->problem().error().hint.empty());
      continue;
    }
    ASSERT_OK(effect->problem());
    SimulatedBlock block = made_block(plan.samples);
    const std::vector<gt3x::Counts> read = block.stored;
    effect->on_firmware(block);
    double held = 0;
    for (std::size_t i = 0; i < block.size(); ++i) {
      held += block.stored[i] != read[i] ? 1 : 0;
    }
    const double asked = c.fraction * static_cast<double>(plan.samples);
    if (c.fraction > 0.5) {  // more than has room
      EXPECT_GT(held, 0.4 * static_cast<double>(plan.samples));
      EXPECT_LT(held, asked);
    } else {
      EXPECT_NEAR(held, asked == 0 ? 0 : std::max(100.0, asked), 50);
    }
  }
}

// One rest of half a minute between 1,000 of a second: it is found.
TEST(IdleSleep, TheOnlyLongRestIsFound) {
  const auto effect = made_effect("idle_sleep", {{"fraction", {0.005}}});
  RecordingPlan plan;
  plan.rate_hz = 30;
  for (std::uint64_t i = 0; i < 1'001; ++i) {
    plan.rests.push_back({plan.samples, i == 500 ? 900U : 30U});
    plan.samples += plan.rests.back().samples;
  }
  effect->on_recording(plan);
  ASSERT_OK(effect->problem());
  SimulatedBlock block = made_block(plan.samples);
  const std::vector<gt3x::Counts> read = block.stored;
  effect->on_firmware(block);
  for (std::size_t i = 0; i < block.size(); ++i) {
    EXPECT_TRUE(block.stored[i] == read[i] || (i > 15'000 && i < 15'900)) << i;
  }
}

// Oracle: the run is what a scenario makes; a bundle of segments of one second each.
TEST(IdleSleep, ARunThatCannotHoldItIsRefused) {
  ProtocolRun run;
  for (std::uint64_t i = 0; i < 50; ++i) {
    ProtocolSegment segment;
    segment.name = "still";
    segment.first_sample = 100 * i;
    segment.samples = 100;
    segment.host_start_s = 10.0 * static_cast<double>(i);
    run.segments.push_back(segment);
  }
  ASSERT_OK(run_protocol(run));
  run.effects = {spec("idle_sleep", {{"fraction", {0.05}}})};
  EXPECT_FAILS(run_protocol(run), ErrorCode::configuration);
}

}  // namespace
}  // namespace sixpoint::sim
