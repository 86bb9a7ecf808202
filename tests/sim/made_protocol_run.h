// Runs through a protocol of a few segments, without noise: closed forms show in the counts.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "sim/protocol_run.h"

namespace sixpoint::tests {

inline sim::EffectSpec spec(const char* name, const sim::ParameterSet& given = {}) {
  const sim::EffectKind* kind = *sim::find_effect(name);
  return {kind, *sim::complete_parameters(*kind, given)};
}

inline Eigen::Matrix3d up(int axis, bool down = false) {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
  for (int k = 0; k < 3; ++k) {
    rotation((axis + 1 + k) % 3, k) = 1;
  }
  return down ? Eigen::Matrix3d(rotation * Eigen::Vector3d(1, -1, -1).asDiagonal()) : rotation;
}

inline sim::ProtocolSegment at_rest(const Eigen::Matrix3d& rotation, std::uint64_t first,
                                    double start_s, std::uint64_t samples = 1000) {
  sim::ProtocolSegment segment;
  segment.name = "faces";
  segment.first_sample = first;
  segment.samples = samples;
  segment.host_start_s = start_s;
  segment.rotation = rotation;
  return segment;
}

// Fine counts and no noise: closed forms show.
inline sim::ProtocolRun quiet(std::vector<sim::ProtocolSegment> segments) {
  sim::ProtocolRun run;
  run.segments = std::move(segments);
  run.accel_scale_lsb_per_g = 1500;
  run.noise_mg = {};
  run.seating_sd_deg = 0;
  return run;
}

inline double mean_mg(const std::vector<gt3x::Counts>& counts, std::size_t first,
                      std::size_t samples, std::size_t axis, double scale = 1500) {
  double sum = 0;
  for (std::size_t i = first; i < first + samples; ++i) {
    sum += counts[i][axis];
  }
  return sum / static_cast<double>(samples) / scale * 1000;
}

inline sim::ProtocolSegment tone(double frequency_hz, double amplitude_g) {
  sim::ProtocolSegment segment = at_rest(up(2), 0, 50, 1000);
  segment.kind = sim::SegmentKind::vibration;
  segment.vibration = sim::Tone{Eigen::Vector3d(0, 0, 2), frequency_hz, amplitude_g, 0.3};
  return segment;
}

// Of z, by a sum over whole periods.
inline double amplitude_mg(const std::vector<gt3x::Counts>& counts, double frequency_hz) {
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

}  // namespace sixpoint::tests
