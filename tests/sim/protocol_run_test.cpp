#include "sim/protocol_run.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/standard_protocol.h"

namespace sixpoint::sim {
namespace {

EffectSpec spec(const char* name, const ParameterSet& given = {}) {
  const EffectKind* kind = *find_effect(name);
  return {kind, *complete_parameters(*kind, given)};
}

Eigen::Matrix3d up(int axis, bool down = false) {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
  for (int k = 0; k < 3; ++k) {
    rotation((axis + 1 + k) % 3, k) = 1;
  }
  return down ? Eigen::Matrix3d(rotation * Eigen::Vector3d(1, -1, -1).asDiagonal()) : rotation;
}

ProtocolSegment still(const Eigen::Matrix3d& rotation, std::uint64_t first, double start_s,
                      std::uint64_t samples = 1000) {
  ProtocolSegment segment;
  segment.name = "faces";
  segment.first_sample = first;
  segment.samples = samples;
  segment.host_start_s = start_s;
  segment.rotation = rotation;
  return segment;
}

// Fine counts and no noise: closed forms show.
ProtocolRun quiet(std::vector<ProtocolSegment> segments) {
  ProtocolRun run;
  run.segments = std::move(segments);
  run.accel_scale_lsb_per_g = 1500;
  run.noise_mg = {};
  run.seating_sd_deg = 0;
  return run;
}

double mean_mg(const std::vector<gt3x::Counts>& counts, std::size_t first, std::size_t samples,
               std::size_t axis, double scale = 1500) {
  double sum = 0;
  for (std::size_t i = first; i < first + samples; ++i) {
    sum += counts[i][axis];
  }
  return sum / static_cast<double>(samples) / scale * 1000;
}

// Oracle: closed forms.
TEST(ProtocolRun, GainOffsetAndRounding) {
  ProtocolRun run = quiet({still(up(0), 0, 30), still(up(1), 1000, 45)});
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
    run.segments.push_back(still(up(i % 3), static_cast<std::uint64_t>(i) * 100, 30 + 10 * i, 100));
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

TEST(ProtocolRun, HysteresisRemembersTheApproach) {
  ProtocolRun run = quiet({still(up(2), 0, 30), still(up(0), 1000, 45), still(up(2), 2000, 60),
                           still(up(2, true), 3000, 75), still(up(0), 4000, 90)});
  run.effects = {spec("hysteresis", {{"mg", {10, 10, 10}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  EXPECT_NEAR(mean_mg(*counts, 0, 1000, 2), 1000, 0.4);     // never moved
  EXPECT_NEAR(mean_mg(*counts, 1000, 1000, 0), 1010, 0.4);  // rose
  EXPECT_NEAR(mean_mg(*counts, 1000, 1000, 2), -10, 0.4);   // fell
  EXPECT_NEAR(mean_mg(*counts, 2000, 1000, 2), 1010, 0.4);  // rose
  EXPECT_NEAR(mean_mg(*counts, 4000, 1000, 2), 10, 0.4);    // rose from -1 to 0
}

TEST(ProtocolRun, SettlingRingsAfterAMoveOnly) {
  ProtocolRun run = quiet({still(up(2), 0, 30), still(up(0), 1000, 45), still(up(0), 2000, 60)});
  run.effects = {
      spec("settling", {{"amplitude", {0.1}}, {"frequency_hz", {5}}, {"decay_s", {0.3}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  for (std::size_t i = 0; i < 100; ++i) {
    const double t = static_cast<double>(i) / 100;
    const double ring = 100 * std::exp(-t / 0.3) * std::cos(2 * std::numbers::pi * 5 * t);
    EXPECT_NEAR(mean_mg(*counts, i, 1, 2), 1000, 0.4);
    EXPECT_NEAR(mean_mg(*counts, 1000 + i, 1, 0), 1000 - ring, 0.4);
    EXPECT_NEAR(mean_mg(*counts, 1000 + i, 1, 2), ring, 0.4);
    EXPECT_NEAR(mean_mg(*counts, 2000 + i, 1, 0), 1000, 0.4);
  }
}

TEST(ProtocolRun, WarmUpAndDriftCountFromPowerOn) {
  ProtocolRun run = quiet({still(up(2), 0, 100, 10), still(up(2), 10, 3600, 10)});
  run.effects = {spec("warm_up", {{"mg", {50, 0, 0}}, {"tau_s", {200}}}),
                 spec("drift", {{"mg_per_h", {0, 20, 0}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  EXPECT_NEAR(mean_mg(*counts, 0, 10, 0), 50 * std::exp(-0.5), 0.4);
  EXPECT_NEAR(mean_mg(*counts, 10, 10, 0), 0, 0.4);
  EXPECT_NEAR(mean_mg(*counts, 10, 10, 1), 20, 0.4);
}

TEST(ProtocolRun, TemperatureComesFromTheLog) {
  ProtocolRun run = quiet({still(up(2), 0, 100, 100), still(up(2), 100, 200, 100)});
  run.temperature = {{0, 25}, {100, 25}, {200, 45}, {300, 45}};
  run.effects = {spec("offset_tempco", {{"mg_per_c", {1, 0, 0}}}),
                 spec("sensitivity_tempco", {{"percent_per_c", {0, 0, 0.05}}})};
  const auto counts = run_protocol(run);
  ASSERT_OK(counts);
  EXPECT_NEAR(mean_mg(*counts, 0, 100, 0), 0.1, 0.4);  // half a second up the ramp
  EXPECT_NEAR(mean_mg(*counts, 100, 100, 0), 20, 0.4);
  EXPECT_NEAR(mean_mg(*counts, 100, 100, 2), 1010, 0.4);
}

ProtocolSegment tone(double frequency_hz, double amplitude_g) {
  ProtocolSegment segment = still(up(2), 0, 50, 1000);
  segment.kind = SegmentKind::vibration;
  segment.vibration = Tone{Eigen::Vector3d(0, 0, 2), frequency_hz, amplitude_g, 0.3};
  return segment;
}

double amplitude_mg(const std::vector<gt3x::Counts>& counts, double frequency_hz) {
  double c = 0;
  double s = 0;
  const double mean = mean_mg(counts, 0, counts.size(), 2);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const double angle = 2 * std::numbers::pi * frequency_hz * static_cast<double>(i) / 100;
    c += (mean_mg(counts, i, 1, 2) - mean) * std::cos(angle);
    s += (mean_mg(counts, i, 1, 2) - mean) * std::sin(angle);
  }
  return std::hypot(c, s) * 2 / static_cast<double>(counts.size());
}

TEST(ProtocolRun, SoftMountResonatesAndBandwidthCuts) {
  ProtocolRun run = quiet({tone(10, 0.1)});
  EXPECT_NEAR(amplitude_mg(*run_protocol(run), 10), 100, 0.3);
  run.effects = {spec("soft_mount", {{"frequency_hz", {10}}, {"q", {3}}})};
  EXPECT_NEAR(amplitude_mg(*run_protocol(run), 10), 100 * std::sqrt(1.0 + 9), 0.5);
  // Butterworth: half the power at the corner, whatever the order.
  for (const double order : {1.0, 2.0, 3.0, 4.0, 6.0}) {
    run.effects = {spec("bandwidth", {{"corner_hz", {10}}, {"order", {order}}})};
    EXPECT_NEAR(amplitude_mg(*run_protocol(run), 10), 100 / std::sqrt(2.0), 0.5) << order;
  }
}

TEST(ProtocolRun, ThirdOrderMakesAThirdHarmonic) {
  ProtocolRun run = quiet({tone(5, 1)});
  run.segments[0].rotation = up(0);
  run.accel_scale_lsb_per_g = 900;
  run.effects = {spec("third_order", {{"mg_per_g3", {40, 0, 0}}})};
  run.segments[0].vibration->direction_lab = Eigen::Vector3d(1, 0, 0);
  // Along lab x the sensor's y feels it: no K3 there.
  const auto flat = run_protocol(run);
  ASSERT_OK(flat);
  for (std::size_t i = 0; i < 1000; ++i) {
    const double expected = std::sin(2 * std::numbers::pi * 5 * static_cast<double>(i) / 100 + 0.3);
    ASSERT_NEAR((*flat)[i][1], 900 * expected, 0.51) << i;
    ASSERT_NEAR((*flat)[i][0], 900 * 1.04, 0.51);
  }
  run.effects = {spec("third_order", {{"mg_per_g3", {0, 40, 0}}})};
  const auto curved = run_protocol(run);
  ASSERT_OK(curved);
  for (std::size_t i = 0; i < 1000; ++i) {
    const double a = std::sin(2 * std::numbers::pi * 5 * static_cast<double>(i) / 100 + 0.3);
    ASSERT_NEAR((*curved)[i][1], 900 * (a + 0.04 * a * a * a), 0.51) << i;
  }
}

TEST(ProtocolRun, SamplingEffectsMoveTime) {
  ProtocolRun run = quiet({still(up(2), 0, 50, 20'000)});
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
  run.effects = {spec("dropped_samples", {{"rate", {0.01}}})};
  EXPECT_NEAR(record_protocol(run)->sample_time_s.back() - 50, 199.99 + 2.02, 0.7);
  run.effects = {spec("jitter", {{"rms_ms", {1}}})};
  const auto shaken = record_protocol(run);
  double power = 0;
  for (std::size_t i = 0; i < 20'000; ++i) {
    power += std::pow(shaken->sample_time_s[i] - 50 - static_cast<double>(i) / 100, 2);
  }
  EXPECT_NEAR(std::sqrt(power / 20'000), 0.001, 0.00003);
}

// Oracle: the definition. Between 0.05 and 0.5 Hz and between 0.5 and 5 Hz a 1/f law has the same
// power; at 1 Hz its one-sided density is mg^2 per Hz.
TEST(ProtocolRun, FlickerHasItsSpectrum) {
  ProtocolRun run;
  run.accel_scale_lsb_per_g = 1500;
  run.noise_mg = {};
  run.seating_sd_deg = 0;
  run.segments = {still(up(2), 0, 50, 120'000)};
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

TEST(ProtocolRun, DigitalEffects) {
  ProtocolRun run = quiet({tone(20, 3)});
  run.effects = {spec("wrap")};
  const auto wrapped = run_protocol(run);
  run.effects = {};
  run.accel_scale_lsb_per_g = 150;
  const auto whole = run_protocol(run);
  ASSERT_OK(wrapped);
  bool over = false;
  for (std::size_t i = 0; i < 1000; ++i) {
    over = over || std::abs(10 * (*whole)[i][2]) > 2047;
    const int expected = ((10 * (*whole)[i][2] + 2048) % 4096 + 4096) % 4096 - 2048;
    const int off = std::abs((*wrapped)[i][2] - expected);
    EXPECT_LE(std::min(off, 4096 - off), 6) << i;
  }
  EXPECT_TRUE(over);
  run = quiet({still(up(2), 0, 50)});
  run.accel_scale_lsb_per_g = 256;
  run.offset_g = {-0.7 / 256, 0.7 / 256, 0};
  run.effects = {spec("rounding_floor")};
  EXPECT_EQ((*run_protocol(run))[0], (gt3x::Counts{-1, 0, 256}));
  run.effects = {spec("truncation")};
  EXPECT_EQ((*run_protocol(run))[0], (gt3x::Counts{0, 0, 256}));
}

TEST(ProtocolRun, IdleSleepHoldsAtRestOnly) {
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
  ProtocolRun run = quiet({still(up(2), 0, 30), still(up(2), 500, 60)});
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
  run = quiet({still(up(2), 0, nan)});
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
  run = quiet({still(up(2), 0, 1, ~std::uint64_t{0})});
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
  run = quiet({still(up(2), 0, 1)});
  run.gain[1] = nan;
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
  run = quiet({still(up(2), 0, 1)});
  run.effects.push_back({});
  EXPECT_FAILS(run_protocol(run), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::sim
