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

}  // namespace
}  // namespace sixpoint::sim
