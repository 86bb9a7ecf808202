// Effects out of functions, for those that are one formula.
//
//   std::unique_ptr<Effect> make_gain(const ParameterSet& values, Random) {
//     const double gain = values.at("gain")[0];
//     return sensed_effect([gain](Eigen::Vector3d& sensed) { sensed *= gain; });
//   }
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "sim/effects/effect.h"

namespace sixpoint::sim {

// Each effect sets the functions that it needs.
struct Parts final : Effect {
  using OfBlock = std::function<void(SimulatedBlock&)>;
  std::function<void(const RecordingPlan&)> recording = [](const RecordingPlan&) {};
  std::function<void(const Placement&)> placement = [](const Placement&) {};
  std::function<void(Tone&)> tone = [](Tone&) {};
  std::function<void(NumberFormat&)> digital = [](NumberFormat&) {};
  OfBlock sampling = [](SimulatedBlock&) {};
  OfBlock stimulus = sampling, sensor = sampling, analog = sampling, firmware = sampling;

  void on_recording(const RecordingPlan& plan) override { recording(plan); }
  void on_placement(const Placement& at) override { placement(at); }
  void on_tone(Tone& of) const override { tone(of); }
  void on_sampling(SimulatedBlock& block) override { sampling(block); }
  void on_stimulus(SimulatedBlock& block) override { stimulus(block); }
  void on_sensor(SimulatedBlock& block) override { sensor(block); }
  void on_analog(SimulatedBlock& block) override { analog(block); }
  void on_digital(NumberFormat& stored) override { digital(stored); }
  void on_firmware(SimulatedBlock& block) override { firmware(block); }
};

// An effect of one function.
template <class Part, class Function>
std::unique_ptr<Effect> acting_at(Part Parts::*part, Function function) {
  auto made = std::make_unique<Parts>();
  (*made).*part = std::move(function);
  return made;
}

// Changes every specific force, in g: change(sensed). At `part` of the sensor, without noise, or
// with its noise (analog).
template <class Change>
std::unique_ptr<Effect> sensed_effect(Change change, Parts::OfBlock Parts::*part = &Parts::sensor) {
  return acting_at(part, [change = std::move(change)](SimulatedBlock& block) mutable {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      change(sensed);
    }
  });
}

// Changes every state of motion: change(motion).
template <class Change>
std::unique_ptr<Effect> motion_effect(Change change) {
  return acting_at(&Parts::stimulus, [change = std::move(change)](SimulatedBlock& block) mutable {
    for (MotionState& motion : block.motion) {
      change(motion);
    }
  });
}

// Changes what is stored of every sample: change(counts).
template <class Change>
std::unique_ptr<Effect> stored_effect(Change change) {
  return acting_at(&Parts::firmware, [change = std::move(change)](SimulatedBlock& block) mutable {
    for (gt3x::Counts& counts : block.stored) {
      change(counts);
    }
  });
}

// Adds a vector in g to what is sensed: vector_g(time_s since power-on, temperature_c).
template <class Vector>
std::unique_ptr<Effect> added_effect(Vector vector_g) {
  return acting_at(&Parts::sensor, [vector_g = std::move(vector_g)](SimulatedBlock& block) mutable {
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.sensed_g[i] += vector_g(block.time_s[i], block.temperature_c[i]);
    }
  });
}

}  // namespace sixpoint::sim
