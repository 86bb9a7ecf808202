// Effects: what the nominal simulator leaves out, one file each under effects/.
//
//   SIXPOINT_ASSIGN(const EffectKind* kind, find_effect("drift"));
//   SIXPOINT_ASSIGN(ParameterSet values, complete_parameters(*kind, {{"mg_per_h", {1, 2, 3}}}));
//   const auto running = make_effects({{kind, values}}, seed);
//
// An effect has a name, parameters (with unit, default, plausible range and source), the stage at
// which it acts, and its forward model: one of the hooks below. The list of effects is data: a
// diagnosis iterates it. Adding an effect means one new file in effects/ and one line in
// effect.cpp.
//
// The simulator works block by block. Per block it fills sample times, motion and temperature, and
// calls the hooks stage by stage, within a stage in the order of the scenario:
//   once      on_digital:   changes rounding and limits: of the sensor, and of what is stored
//             on_recording: learns how long it will be
//   per pose  on_placement: learns from where the unit came, and whether it was taken off
//             on_tone:      changes what the shaker does to the unit
//   sampling  on_sampling:  moves time_s
//   stimulus  on_stimulus:  changes force_lab_g and rotation
//   sensor    on_sensor:    changes sensed_g, without noise
//             on_analog:    changes sensed_g with its noise: the front end
//   firmware  on_firmware:  changes stored
// A block never spans a placement. Two callers drive these hooks: Simulator (simulator.h), a unit
// in free motion, and run_protocol (protocol_run.h), a unit in a calibration protocol.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/measure.h"
#include "base/random.h"
#include "base/result.h"
#include "gt3x/log/samples.h"

namespace sixpoint::sim {

// Where a unit is and what acts on it at one moment. `rotation` maps the laboratory's frame (z up)
// to the sensor's: at rest the specific force in the sensor's frame is rotation * (0, 0, 1) g.
struct MotionState {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d force_lab_g = Eigen::Vector3d::UnitZ();
};

// A shaker's tone: the specific force amplitude_g sin(2 pi f t + phase) along a direction of the
// laboratory, t since the motion's or the segment's start.
struct Tone {
  Eigen::Vector3d direction_lab = Eigen::Vector3d::UnitX();
  double frequency_hz = 5;
  double amplitude_g = 0.5;
  double phase_rad = 0;
};

// The unit has come to rest in a pose, or goes on in it.
struct Placement {
  double start_s = 0;                                      // since power-on
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // as commanded
  Eigen::Matrix3d previous =
      Eigen::Matrix3d::Identity();  // the pose before; the same for the first
  bool anew = true;                 // the unit was taken off, or turned: it sits differently
  bool contiguous = false;          // the samples before it were recorded immediately before
};

struct RecordingPlan {
  struct Stretch {
    std::uint64_t first_sample = 0;
    std::uint64_t samples = 0;
  };
  double rate_hz = 30;
  std::uint64_t samples = 0;   // 0 = open end
  std::vector<Stretch> rests;  // when the unit lies still; none = not known

  // What an effect may spread itself over: an hour where the end is open.
  std::uint64_t length() const {
    return samples > 0 ? samples : static_cast<std::uint64_t>(3600 * rate_hz);
  }
};

struct SimulatedBlock {
  std::uint64_t first_sample = 0;
  double clock_start_s = 0;               // time since power-on at which the sample clock started
  std::vector<double> time_s;             // true time of each sample since power-on
  std::vector<MotionState> motion;        // per sample
  std::vector<Eigen::Vector3d> true_g;    // specific force in the case's axes: the truth
  std::vector<Eigen::Vector3d> sensed_g;  // the same as the sensor element has it
  std::vector<double> temperature_c;      // of the die
  std::vector<PerAxis<int>> raw_lsb;      // the sensor's reading
  std::vector<gt3x::Counts> stored;       // what the firmware makes of it

  std::size_t size() const { return time_s.size(); }
};

// How a real number becomes an integer of limited width.
struct NumberFormat {
  enum class Rounding { half_away, toward_zero, down };
  Rounding rounding = Rounding::half_away;
  bool wraps = false;  // overflows modulo 4096 instead of clipping
  // The sensor clips where so many g would be stored: a recording piles up there.
  double limit_g = std::numeric_limits<double>::infinity();

  double limited(double value_g) const { return std::clamp(value_g, -limit_g, limit_g); }

  // Rounds, then clips to [low, high] and says so; or wraps into -2048 ... 2047.
  double to_integer(double value, double low, double high, bool& clipped) const {
    double integer = 0;
    switch (rounding) {
      case Rounding::half_away:
        integer = std::round(value);
        break;
      case Rounding::toward_zero:
        integer = std::trunc(value);
        break;
      case Rounding::down:
        integer = std::floor(value);
        break;
    }
    if (wraps && std::isfinite(integer)) {
      return integer - 4096 * std::floor((integer + 2048) / 4096);
    }
    if (!(integer >= low && integer <= high)) {
      clipped = true;
      integer = integer < low ? low : high;
    }
    return integer;
  }
};

enum class Stage { stimulus, sensor, sampling, digital, firmware };
std::string_view to_string(Stage stage);

struct Parameter {
  std::string name;
  std::string unit;
  std::vector<double> default_value;  // one number, three: per axis, or nine: a matrix by rows
  double low = 0;                     // plausible range of each number
  double high = 0;
  std::string source;  // where default and range come from
};

// Values by parameter name, complete and checked: as many numbers as the parameter has.
using ParameterSet = std::map<std::string, std::vector<double>, std::less<>>;

// A running effect; lives as long as one simulation and may keep state from block to block.
class Effect {
 public:
  virtual ~Effect() = default;
  virtual void on_recording(const RecordingPlan& /*plan*/) {}
  // configuration where the recording that on_recording() was told of has no room for the effect: it
  // would be a recording without it.
  virtual Status problem() const { return {}; }
  virtual void on_placement(const Placement& /*placement*/) {}
  virtual void on_tone(Tone& /*tone*/) const {}
  virtual void on_sampling(SimulatedBlock& /*block*/) {}
  virtual void on_stimulus(SimulatedBlock& /*block*/) {}
  virtual void on_sensor(SimulatedBlock& /*block*/) {}
  virtual void on_analog(SimulatedBlock& /*block*/) {}
  virtual void on_digital(NumberFormat& /*stored*/) {}
  virtual void on_firmware(SimulatedBlock& /*block*/) {}
  // True where the effect needs the signal of some time before the first stored sample.
  virtual bool needs_run_in() const { return false; }
};

// An entry of the catalogue.
struct EffectKind {
  std::string name;
  Stage stage;
  std::string summary;
  std::vector<Parameter> parameters;
  // `random` is a stream of the effect's own.
  std::function<std::unique_ptr<Effect>(const ParameterSet& values, Random random)> make;
};

const std::vector<EffectKind>& effect_catalogue();
// configuration where there is none of that name.
Result<const EffectKind*> find_effect(std::string_view name);

// Defaults for what `given` leaves out. configuration on an unknown name, a wrong count, or a
// number that is not finite; a number outside the plausible range is allowed (tests need it).
Result<ParameterSet> complete_parameters(const EffectKind& kind, const ParameterSet& given);

// An effect with its parameters, as a scenario or a protocol run has it.
struct EffectSpec {
  const EffectKind* kind = nullptr;
  ParameterSet values;  // complete
};

// The first problem() among them.
Status check_effects(const std::vector<std::unique_ptr<Effect>>& effects);

// Running effects in the order of `specs`, each with a stream of its own.
std::vector<std::unique_ptr<Effect>> make_effects(const std::vector<EffectSpec>& specs,
                                                  std::uint64_t seed);

}  // namespace sixpoint::sim
