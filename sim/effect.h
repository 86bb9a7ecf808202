// Effects: what the nominal simulator leaves out, one file each under effects/.
//
// An effect has a name, parameters (with unit, default, plausible range and source), the stage at
// which it acts, and its forward model: one of the hooks below. The list of effects is data: a
// diagnosis iterates it. Adding an effect means one new file in effects/ and one line in
// effect.cpp.
//
// The simulator works block by block. Per block it fills sample times, motion and temperature, and
// calls the hooks stage by stage, within a stage in the order of the scenario:
//   sampling  on_sampling: moves time_s
//   stimulus  on_stimulus: changes force_lab_g and rotation
//   sensor    on_sensor:   changes sensed_g
//   digital   on_digital:  changes rounding and limits, once, before the first block
//   firmware  on_firmware: changes stored
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/measure.h"
#include "base/random.h"
#include "base/result.h"
#include "gt3x/samples.h"

namespace sixpoint::sim {

// Where a unit is and what acts on it at one moment. `rotation` maps the laboratory's frame (z up)
// to the sensor's: at rest the specific force in the sensor's frame is rotation * (0, 0, 1) g.
struct MotionState {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d force_lab_g = Eigen::Vector3d::UnitZ();
};

struct SimulatedBlock {
  std::uint64_t first_sample = 0;
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

  // Rounds, then clips to [low, high] and says so.
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
    if (integer < low || integer > high) {
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
  std::vector<double> default_value;  // one number, or three: per axis
  double low = 0;                     // plausible range of each number
  double high = 0;
  std::string source;  // where default and range come from
};

// Values by parameter name, complete and checked: one or three numbers as the parameter has.
using ParameterSet = std::map<std::string, std::vector<double>, std::less<>>;

// A running effect; lives as long as one simulation and may keep state from block to block.
class Effect {
 public:
  virtual ~Effect() = default;
  virtual void on_sampling(SimulatedBlock& /*block*/) {}
  virtual void on_stimulus(SimulatedBlock& /*block*/) {}
  virtual void on_sensor(SimulatedBlock& /*block*/) {}
  virtual void on_digital(NumberFormat& /*stored*/) {}
  virtual void on_firmware(SimulatedBlock& /*block*/) {}
};

// An entry of the catalogue.
struct EffectKind {
  std::string name;
  Stage stage;
  std::string summary;
  std::vector<Parameter> parameters;
  // `random` is a stream of the effect's own.
  std::unique_ptr<Effect> (*make)(const ParameterSet& values, Random random);
};

const std::vector<EffectKind>& effect_catalogue();
// configuration where there is none of that name.
Result<const EffectKind*> find_effect(std::string_view name);

// Defaults for what `given` leaves out. configuration on an unknown name, a wrong count, or a
// number that is not finite; a number outside the plausible range is allowed (tests need it).
Result<ParameterSet> complete_parameters(const EffectKind& kind, const ParameterSet& given);

}  // namespace sixpoint::sim
