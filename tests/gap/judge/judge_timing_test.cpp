#include <cmath>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "gap/judge/made_step.h"
#include "gap/simulated_bundle.h"

namespace sixpoint::gap {
namespace {

using tests::effect;
using tests::Made;

TEST(JudgeTiming, AToneAtADifferentFrequencyIsAClock) {
  ToneFit tone;
  tone.frequency_ppm = 100;
  EXPECT_NEAR(clock_ppm_of(tone), -100 / 1.0001, 1e-9);
}

TEST(JudgeTiming, AFastClockIsMeasured) {
  Bundle bundle = tests::made_production({});
  constexpr double kPpm = 600;
  // Stamps of a clock that runs fast come earlier: a second of samples lasts 1 / (1 + e).
  for (std::size_t k = 0; k < bundle.host_clock.host_time_s.size(); ++k) {
    const Segment& s = bundle.segments[bundle.host_clock.sample_index[k] / 1000];
    double& t = bundle.host_clock.host_time_s[k];
    t = s.host_start_s + (t - s.host_start_s) / (1 + 1e-6 * kPpm);
  }
  const Made made(std::move(bundle));
  const Timing timing = judge_timing(made.request, made.clean, made.noise);
  const EffectFinding* clock = effect(timing.found, "clock_error");
  ASSERT_NE(clock, nullptr);
  EXPECT_NEAR(clock->parameters[0].value[0], kPpm, 4 * clock->parameters[0].sd[0]);
  EXPECT_TRUE(clock->outside_datasheet);
  EXPECT_EQ(effect(timing.found, "dropped_samples"), nullptr);
}

// Oracle: the truth of simulated units. The size has no bias, and its uncertainty is what it says: of
// eight within two standard uncertainties six at least (fewer once in 200).
TEST(JudgeTiming, JitterHasNoBias) {
  constexpr double kTrue_ms = 1.5;
  constexpr int kUnits = 8;
  double sum_ms = 0;
  double variance = 0;
  int within = 0;
  for (int seed = 500; seed < 500 + kUnits; ++seed) {
    auto bundle = tests::simulated(
        {{"schema", "sixpoint/scenario/1"},
         {"seed", seed},
         {"protocol", "engineering"},
         {"effects", {{{"name", "jitter"}, {"parameters", {{"rms_ms", kTrue_ms}}}}}}});
    ASSERT_OK(bundle);
    const Made made(*std::move(bundle));
    const Timing timing = judge_timing(made.request, made.clean, made.noise);
    const EffectFinding* jitter = effect(timing.found, "jitter");
    ASSERT_NE(jitter, nullptr);
    const double found_ms = jitter->parameters[0].value[0];
    const double sd_ms = jitter->parameters[0].sd[0];
    sum_ms += found_ms;
    variance += sd_ms * sd_ms;
    within += std::abs(found_ms - kTrue_ms) < 2 * sd_ms ? 1 : 0;
  }
  EXPECT_NEAR(sum_ms / kUnits, kTrue_ms, 2.5 * std::sqrt(variance) / kUnits);
  EXPECT_GE(within, 6);
}

// Oracle: the truth of simulated units. Where samples are lost the phase is wrong for some samples;
// what lies between is judged, and gives a size where there is one and none where there is none.
TEST(JudgeTiming, JitterIsFoundBetweenLostSamples) {
  for (const double true_ms : {0.0, 0.8}) {
    nlohmann::ordered_json scenario = {
        {"schema", "sixpoint/scenario/1"},
        {"seed", 510},
        {"protocol", "engineering"},
        {"effects", {{{"name", "dropped_samples"}, {"parameters", {{"rate", 0.005}}}}}}};
    if (true_ms > 0) {
      scenario["effects"].push_back({{"name", "jitter"}, {"parameters", {{"rms_ms", true_ms}}}});
    }
    auto bundle = tests::simulated(scenario);
    ASSERT_OK(bundle);
    const Made made(*std::move(bundle));
    const Timing timing = judge_timing(made.request, made.clean, made.noise);
    EXPECT_GT(std::ranges::count_if(timing.tones,
                                    [](const ToneFit& tone) { return !tone.slips.empty(); }),
              20);
    EXPECT_NE(effect(timing.found, "dropped_samples"), nullptr);
    const EffectFinding* jitter = effect(timing.found, "jitter");
    ASSERT_EQ(jitter != nullptr, true_ms > 0);
    if (jitter != nullptr) {
      EXPECT_NEAR(jitter->parameters[0].value[0], true_ms, 3 * jitter->parameters[0].sd[0]);
    }
  }
}

TEST(JudgeTiming, LostSamplesAreCounted) {
  Bundle bundle = tests::made_production({});
  for (const std::size_t segment : {3U, 11U}) {
    for (std::size_t packet = 5; packet < 10; ++packet) {
      bundle.host_clock.host_time_s[10 * segment + packet] += 0.01;  // one sample at 100 Hz
    }
  }
  const Made made(std::move(bundle));
  const Timing timing = judge_timing(made.request, made.clean, made.noise);
  const EffectFinding* lost = effect(timing.found, "dropped_samples");
  ASSERT_NE(lost, nullptr);
  EXPECT_EQ(lost->nats, 12 * 2 - 3.5);
  EXPECT_NEAR(lost->parameters[0].value[0], 2.0 / static_cast<double>(timing.host.samples), 1e-12);
}

// Slips of these sizes (samples), each in a segment of its own.
Findings found_with(const std::vector<int>& slips) {
  Bundle bundle = tests::made_production({});
  for (std::size_t k = 0; k < slips.size(); ++k) {
    for (std::size_t packet = 5; packet < 10; ++packet) {
      bundle.host_clock.host_time_s[10 * k + packet] += 0.01 * slips[k];  // at 100 Hz
    }
  }
  const Made made(std::move(bundle));
  return judge_timing(made.request, made.clean, made.noise).found;
}

TEST(JudgeTiming, SamplesThatAreLostInRunsHaveAnotherCause) {
  // What two independent generators make of the catalogue's effect: up to four together.
  for (const std::vector<int>& few : {std::vector{1, 1}, {1, 2, 1}, {4}, {4, 1, 2}, {-1, -3}}) {
    EXPECT_TRUE(found_with(few).alarms.empty()) << few.size();
  }
  const Findings burst = found_with({27, 9});
  ASSERT_EQ(burst.alarms.size(), 1);
  // (27 * 27 + 9 * 9) / 36, less 36 in 162 packets.
  EXPECT_EQ(burst.alarms[0].where, "timing: samples are missing, about 22 together");
  EXPECT_NE(effect(burst, "dropped_samples"), nullptr);  // they are lost all the same
  const Findings twice = found_with({-30, 1});
  ASSERT_EQ(twice.alarms.size(), 1);
  EXPECT_EQ(twice.alarms[0].where, "timing: samples are there twice, about 30 together");
}

}  // namespace
}  // namespace sixpoint::gap
