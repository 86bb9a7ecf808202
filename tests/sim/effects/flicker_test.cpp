#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/effects/made_effect.h"
#include "sim/made_protocol_run.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

// Oracle: the definition. Between 0.05 and 0.5 Hz and between 0.5 and 5 Hz a 1/f law has the same
// power; at 1 Hz its one-sided density is mg^2 per Hz.
TEST(Flicker, FlickerHasItsSpectrum) {
  ProtocolRun run;
  run.accel_scale_lsb_per_g = 1500;
  run.noise_mg = {};
  run.seating_sd_deg = 0;
  run.segments = {at_rest(up(2), 0, 50, 120'000)};
  run.effects = {spec("flicker", {{"mg", {5}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  // Allan variance at 0.1, 1 and 10 s: 2 ln 2 mg^2 each.
  for (const std::size_t piece : {10U, 100U, 1000U}) {
    double power = 0;
    double n = 0;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      for (std::size_t i = 0; i + 2 * piece <= counts->size(); i += piece) {
        const double step =
            mean_mg(*counts, i + piece, piece, axis) - mean_mg(*counts, i, piece, axis);
        power += step * step / 2;
        n += 1;
      }
    }
    EXPECT_NEAR(std::sqrt(power / n) / (5 * std::sqrt(2 * std::numbers::ln2)), 1, 0.15) << piece;
  }
}

// Mean square of the change over a pause, in mg^2; five minutes between two pauses.
double change_over_mg2(double pause_s) {
  constexpr std::size_t kPauses = 4000;
  const auto effect = made_effect("flicker", {{"mg", {1}}});
  RecordingPlan plan;
  plan.rate_hz = 100;
  effect->on_recording(plan);
  SimulatedBlock block = made_block(2 * kPauses);
  for (std::size_t i = 0; i < kPauses; ++i) {
    block.time_s[2 * i] = static_cast<double>(i + 1) * (pause_s + 300);
    block.time_s[2 * i + 1] = block.time_s[2 * i] + pause_s;
  }
  effect->on_sensor(block);
  double power = 0;
  for (std::size_t i = 0; i < kPauses; ++i) {
    power += (1000 * (block.sensed_g[2 * i + 1] - block.sensed_g[2 * i])).squaredNorm();
  }
  return power / (3 * kPauses);
}

// Oracle: the structure function of a 1/f density of mg^2 / f. The mean square of the change over T
// is 2 mg^2 (ln T + a constant of the highest frequency), so from 1 s to 100 s it grows by
// 2 mg^2 ln 100 = 9.21 mg^2. Standard error 0.3 mg^2.
TEST(Flicker, OverAPauseItGoesOnByItsLaw) {
  EXPECT_NEAR(change_over_mg2(100) - change_over_mg2(1), 2 * std::log(100.0), 1.2);
}

}  // namespace
}  // namespace sixpoint::sim
