// A unit's run through a calibration protocol: what it would store.
//
//   ProtocolRun run;
//   run.segments = draw_protocol(StandardProtocol::production, seed);
//   SIXPOINT_ASSIGN(const auto counts, run_protocol(run));
//
// This is the nominal simulator of the gap's diagnosis with effects switched on at will: specific
// force in the sensor's frame from each segment's pose and vibration; per-axis gain and offset of
// this unit; white noise; a small seating error, new at every placement; rounding to whole counts
// and 12 bits. Time runs on between the segments (host time since power-on). The motion between
// them is left out, the transient after each move is not. The pose before the first segment is the
// pose of the first.
//
// Fast on purpose, since a diagnosis calls it often: a hundred nanoseconds or so per sample.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/measure.h"
#include "base/result.h"
#include "gt3x/log/samples.h"
#include "sim/effects/effect.h"

namespace sixpoint::sim {

enum class SegmentKind { still, vibration, ramp, soak };
std::string_view to_string(SegmentKind kind);
std::optional<SegmentKind> parse_segment_kind(std::string_view name);

struct ProtocolSegment {
  std::string name;
  SegmentKind kind = SegmentKind::still;
  std::uint64_t first_sample = 0;
  std::uint64_t samples = 0;
  double host_start_s = 0;                                 // since power-on
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // maps the laboratory to the sensor
  std::array<double, 2> commanded_c = {23, 23};            // at the start and at the end
  std::optional<Tone> vibration;                           // phase at the segment's start
};

// What the unit's thermometer says. run_protocol interpolates between the points and takes them as
// they are: smooth a noisy log before.
struct TemperaturePoint {
  double host_time_s = 0;
  double temperature_c = 0;
};

// White noise of the nominal unit per axis, standard deviation of one sample. Its density is the
// same at every sample rate (ADXL362 datasheet: the bandwidth follows the rate), so it grows with
// the root of the rate.
PerAxis<double> nominal_noise_mg(double rate_hz);

struct ProtocolRun {
  double rate_hz = 100;
  double accel_scale_lsb_per_g = 256;
  double gravity_g = 1;                       // as the operator entered it
  std::vector<ProtocolSegment> segments;      // in the order of their samples
  std::vector<TemperaturePoint> temperature;  // in the order of time; none: 25 C throughout
  PerAxis<double> gain = {1, 1, 1};
  PerAxis<double> offset_g = {0, 0, 0};
  PerAxis<double> noise_mg = {3.9, 3.9, 5.5};  // standard deviation per sample; of 100 Hz
  double seating_sd_deg = 0.01;                // per axis, new at every placement
  std::vector<EffectSpec> effects;
  std::uint64_t seed = 1;
  // A segment that follows without a pause starts when the one before really ended, however its
  // sample clock ran, and not at its host_start_s. For making a recording, not for repeating one.
  bool contiguous_segments_follow = false;
};

// True where `next` is the same placement as `before`: no pause in the same pose, or the next tone
// on the same axis of the shaker within a few seconds.
bool same_placement(const ProtocolSegment& before, const ProtocolSegment& next, double rate_hz);
// True where no sample is missing between them. Sampling effects stretch or shrink a segment by up
// to 2 %, so pose, kind and time are compared with that allowance.
bool follows_without_pause(const ProtocolSegment& before, const ProtocolSegment& next,
                           double rate_hz);

struct ProtocolRecord {
  std::vector<gt3x::Counts> counts;
  std::vector<double> sample_time_s;  // true time of each stored sample since power-on
  std::vector<double> host_start_s;   // of each segment, as it really was
};

// What the unit stores: one sample per index, segments[i].first_sample on its segment; zeros where
// no segment is. bad_data where segments overlap, are out of order, hold no finite numbers or are
// more than 100 million samples; configuration where an effect has no room. The same run gives the
// same counts on every machine.
Result<std::vector<gt3x::Counts>> run_protocol(const ProtocolRun& run);
// The same, with the times.
Result<ProtocolRecord> record_protocol(const ProtocolRun& run);

}  // namespace sixpoint::sim
