// A bundle: one unit's recording of one protocol, and what the station knew meanwhile.
//
// A folder with recording.gt3x, protocol.json, temperature.csv and host_clock.csv. Files are read
// through the FileSystem that was given. Input is hostile: whatever contradicts itself is
// `bad_data`, whatever is merely missing becomes a line of `losses`, in words for a person.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/measure.h"
#include "base/result.h"
#include "gt3x/samples.h"

namespace sixpoint::gap {

// `direction_lab` is of unit length; the phase at the segment's start is unknown.
struct Vibration {
  Eigen::Vector3d direction_lab = Eigen::Vector3d::UnitZ();
  double frequency_hz = 0;
  double amplitude_g = 0;
};

struct Segment {
  enum class Kind { still, vibration, ramp, soak };
  std::string name;
  Kind kind = Kind::still;
  std::size_t first_sample = 0;
  std::size_t samples = 0;
  double host_start_s = 0;                                 // since power-on
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // laboratory (z up) to sensor
  double temperature_start_c = 0;                          // commanded
  double temperature_end_c = 0;
  std::optional<Vibration> vibration;

  // Derived by the reader. Segments of one placement were recorded without taking the unit up:
  // one follows the other without a pause, or they are tones of one shaker axis.
  int pose = 0;  // equal rotations have equal numbers, counted in order of appearance
  int placement = 0;
  bool starts_placement = true;
  bool settled = false;  // at rest from its first sample on, as a jig's readings are
  // Samples at the start may still ring from the move.
  bool may_ring() const { return starts_placement && !settled; }
  // Specific force now less that of the pose before, sensor's frame, g: how it was approached.
  Eigen::Vector3d approach_g = Eigen::Vector3d::Zero();
  // Per axis the sign of its last step, 0 before the first: a step that leaves an axis where it was
  // leaves this, too.
  Eigen::Vector3d held_sign = Eigen::Vector3d::Zero();
};

struct TemperatureLog {
  std::vector<double> host_time_s;  // ascending
  std::vector<double> temperature_c;
  bool empty() const { return host_time_s.empty(); }
};

// When the host received each one-second packet, +-2 ms uniform.
struct HostClock {
  std::vector<std::size_t> sample_index;  // ascending: the packet's first sample
  std::vector<double> host_time_s;        // of that sample
  bool empty() const { return sample_index.empty(); }
};

// What the header says. Headers are copied and lie: evidence for a candidate, never a veto.
struct Header {
  std::string serial;
  std::string model;
  std::string firmware;
  std::optional<UtcTime> calibration_time;
};

struct Bundle {
  std::string path;
  double rate_hz = 100;
  double accel_scale_lsb_per_g = 256;
  double gravity_g = 1;  // what the operator believes
  Header header;         // of the recording
  std::string protocol_serial;
  std::vector<Segment> segments;
  std::vector<gt3x::Counts> samples;
  TemperatureLog temperature;
  HostClock host_clock;
  std::vector<std::string> losses;  // what is missing, and what can't be found without it

  // The unit's temperature at a host time: its own log, smoothed over half a minute; without one
  // the commanded temperature.
  double temperature_at(double host_time_s) const;
  // Specific force of gravity in the sensor's frame during a segment, g.
  Eigen::Vector3d gravity_in_sensor(const Segment& segment) const {
    return gravity_g * segment.rotation.col(2);
  }
};

struct BundleLimits {
  std::size_t max_samples = 20'000'000;  // two days at 100 Hz, 120 MB
  std::size_t max_segments = 5'000;      // fifty times the engineering protocol
};

// no_input where the folder, protocol.json or recording.gt3x is missing; bad_data where the
// protocol is no JSON of schema sixpoint/bundle/1, lacks a key, holds a number that can't be, a
// rotation that is none, segments that overlap or reach beyond the recording, or a scale or sample
// rate that the header contradicts and the samples do not bear out (header_evidence.h).
Result<Bundle> read_bundle(FileSystem& files, const std::string& folder,
                           const BundleLimits& limits = {});

}  // namespace sixpoint::gap
