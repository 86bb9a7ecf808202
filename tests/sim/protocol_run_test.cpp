#include "sim/protocol_run.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/made_protocol_run.h"
#include "sim/standard_protocol.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

// Oracle: closed forms.
TEST(ProtocolRun, GainOffsetAndRounding) {
  ProtocolRun run = quiet({at_rest(up(0), 0, 30), at_rest(up(1), 1000, 45)});
  run.accel_scale_lsb_per_g = 256;
  run.gain = {1.1, 1, 1};
  run.offset_g = {0, 0.02, 0};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  EXPECT_EQ((*counts)[500], (gt3x::Counts{282, 5, 0}));   // 281.6, 5.12
  EXPECT_EQ((*counts)[1500], (gt3x::Counts{0, 261, 0}));  // 261.12
}

TEST(ProtocolRun, NoiseAndSeatingHaveTheirSize) {
  ProtocolRun run;
  run.seating_sd_deg = 0.2;
  for (int i = 0; i < 400; ++i) {
    run.segments.push_back(
        at_rest(up(i % 3), static_cast<std::uint64_t>(i) * 100, 30 + 10 * i, 100));
  }
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  double power = 0;
  double n = 0;
  for (std::size_t i = 0; i < 400; ++i) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (axis != i % 3) {
        power += std::pow(mean_mg(*counts, i * 100, 100, axis, 256), 2);
        n += 1;
      }
    }
  }
  // 0.2 degree = 3.49 mg across; a mean of 100 samples adds 0.4 to 0.55 mg.
  EXPECT_NEAR(std::sqrt(power / n), 3.52, 0.3);
}

TEST(ProtocolRun, TemperatureComesFromTheLog) {
  ProtocolRun run = quiet({at_rest(up(2), 0, 100, 100), at_rest(up(2), 100, 200, 100)});
  run.temperature = {{0, 25}, {100, 25}, {200, 45}, {300, 45}};
  run.effects = {spec("offset_tempco", {{"mg_per_c", {1, 0, 0}}}),
                 spec("sensitivity_tempco", {{"percent_per_c", {0, 0, 0.05}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  EXPECT_NEAR(mean_mg(*counts, 0, 100, 0), 0.1, 0.4);  // half a second up the ramp
  EXPECT_NEAR(mean_mg(*counts, 100, 100, 0), 20, 0.4);
  EXPECT_NEAR(mean_mg(*counts, 100, 100, 2), 1010, 0.4);
}

TEST(ProtocolRun, SameSeedSameCountsWithEverythingOn) {
  ProtocolRun run;
  run.segments = draw_protocol(StandardProtocol::production, 3);
  for (const EffectKind& kind : effect_catalogue()) {
    run.effects.push_back({&kind, *complete_parameters(kind, {})});
  }
  const auto first = run_protocol(run);
  ASSERT_OK(first);
  EXPECT_EQ(*first, *run_protocol(run));
  run.seed = 2;
  EXPECT_NE(*first, *run_protocol(run));
}

TEST(ProtocolRun, RefusesWhatMakesNoSense) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_OK(run_protocol({}));
  ProtocolRun run = quiet({at_rest(up(2), 0, 30), at_rest(up(2), 500, 60)});
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
  run = quiet({at_rest(up(2), 0, nan)});
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
  run = quiet({at_rest(up(2), 0, 1, ~std::uint64_t{0})});
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
  run = quiet({at_rest(up(2), 0, 1)});
  run.gain[1] = nan;
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
  run = quiet({at_rest(up(2), 0, 1)});
  run.effects.push_back({});
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::sim
