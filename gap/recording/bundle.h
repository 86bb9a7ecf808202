// A bundle: one unit's recording of one protocol, and what the station knew meanwhile.
//
//   SIXPOINT_ASSIGN(const Bundle bundle, read_bundle(env.files, "bundle"));
//   for (const Segment& segment : bundle.segments) {
//     const gt3x::Counts& first = bundle.samples[segment.first_sample];
//   }
//
// A folder with recording.gt3x, protocol.json, temperature.csv and host_clock.csv. Files are not
// trusted: a contradiction is `bad_data`, a missing log becomes a line of `losses`, in words for a
// person. A Bundle is plain data; it refers to nothing outside itself.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/measure.h"
#include "base/result.h"
#include "gt3x/log/samples.h"

namespace sixpoint::gap {

// `direction_lab` is of unit length; the phase at the segment's start is unknown.
struct Vibration {
  Eigen::Vector3d direction_lab = Eigen::Vector3d::UnitZ();
  double frequency_hz = 0;
  double amplitude_g = 0;
};

// Per axis the sign of its last step, 0 before the first. Smaller steps do not change the sign;
// which are too small is not known of a unit, so that each of kLeastSteps_g has a column.
inline constexpr std::array<double, 4> kLeastSteps_g = {0.02, 0.05, 0.1, 0.2};
inline constexpr Eigen::Index kUsualStep = 1;  // column for those who take one
using HeldSigns = Eigen::Matrix<double, 3, kLeastSteps_g.size()>;
void hold_step(HeldSigns& held, const Eigen::Vector3d& step_g);

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
  bool at_rest() const { return kind != Kind::vibration; }
  // The first sample, counted from the segment's, at which ringing is over.
  std::size_t quiet_start(double rate_hz) const {
    constexpr double kRinging_s = 3;  // five times the longest decay of the catalogue, 0.6 s
    return may_ring() ? std::min(samples, static_cast<std::size_t>(kRinging_s * rate_hz)) : 0;
  }
  // Specific force now less that of the pose before, sensor's frame, g: how it was approached.
  Eigen::Vector3d approach_g = Eigen::Vector3d::Zero();
  HeldSigns held_sign = HeldSigns::Zero();
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

// What the header says. Headers are copied and can be wrong: evidence for a candidate, never a
// veto.
struct Header {
  std::string serial;
  std::string firmware;
};

struct Bundle {
  std::string path;
  double rate_hz = 100;
  double accel_scale_lsb_per_g = 256;
  double gravity_g = 1;  // by the protocol
  Header header;         // of the recording
  std::string protocol_serial;
  std::vector<Segment> segments;
  std::vector<gt3x::Counts> samples;
  TemperatureLog temperature;
  HostClock host_clock;
  std::vector<std::string> losses;  // what is missing, and what can't be found without it

  // The unit's temperature at a host time. Without a log: the commanded one. Else by the log, smoothed over half a
  // minute, and what the command did since:
  //
  // | the two readings about that time  | the command between them   | answer                                |
  // |-----------------------------------|----------------------------|---------------------------------------|
  // | at most a minute apart            | any                        | on the line between them              |
  // | more                              | jumps by more than 2 C     | the same                              |
  // | more                              | does not                   | the line, and by how much the command |
  // |                                   |                            | differs from the line of its own      |
  // | only one, before or after it all  | jumps by more than 2 C     | that reading                          |
  // | only one                          | does not                   | that reading and the command's change |
  //
  // A unit follows a ramp within minutes; after a jump of the command nobody knows where it is.
  double temperature_at(double host_time_s) const;
  // What the protocol commands: within a segment on the line from its start to its end, behind it its end.
  double commanded_c(double host_time_s) const;
  // Specific force of gravity in the sensor's frame during a segment, g.
  Eigen::Vector3d gravity_in_sensor(const Segment& segment) const {
    return gravity_g * segment.rotation.col(2);
  }
};

// no_input where the folder, protocol.json or recording.gt3x is missing; bad_data where the
// protocol is no JSON of schema sixpoint/bundle/1, lacks a key, holds a number that can't be, a
// rotation that is none, segments that overlap or reach beyond the recording, or a scale or sample
// rate that header and samples contradict (header_evidence.h).
Result<Bundle> read_bundle(FileSystem& files, const std::string& folder);

}  // namespace sixpoint::gap
