// What the kinds outside the catalogue are built of (gap_outside.h); nobody else needs it.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <numbers>
#include <string_view>
#include <vector>

#include "base/random.h"
#include "station/gap_outside.h"

namespace sixpoint::station::outside_parts {

using sim::Effect;
using sim::EffectKind;
using sim::ParameterSet;
using sim::Placement;
using sim::RecordingPlan;
using sim::SimulatedBlock;
using sim::Stage;

inline constexpr double kTwoPi = 2 * std::numbers::pi;

// An effect out of functions: each kind sets those it needs.
struct Parts final : Effect {
  std::function<void(const RecordingPlan&)> recording;
  std::function<void(const Placement&)> placement;
  std::function<void(sim::Tone&)> tone;
  std::function<void(SimulatedBlock&)> sampling, stimulus, sensor, analog, firmware;

  void on_recording(const RecordingPlan& plan) override {
    if (recording) {
      recording(plan);
    }
  }
  void on_placement(const Placement& at) override {
    if (placement) {
      placement(at);
    }
  }
  void on_tone(sim::Tone& of) const override {
    if (tone) {
      tone(of);
    }
  }
  void on_sampling(SimulatedBlock& block) override { run(sampling, block); }
  void on_stimulus(SimulatedBlock& block) override { run(stimulus, block); }
  void on_sensor(SimulatedBlock& block) override { run(sensor, block); }
  void on_analog(SimulatedBlock& block) override { run(analog, block); }
  void on_firmware(SimulatedBlock& block) override { run(firmware, block); }

 private:
  static void run(const std::function<void(SimulatedBlock&)>& part, SimulatedBlock& block) {
    if (part) {
      part(block);
    }
  }
};

using Made = std::unique_ptr<Effect>;

// What a kind draws from.
struct Draw {
  double severity;
  Random random;

  double between(double low, double high) { return random.uniform(low, high); }
  double between_log(double low, double high) {
    return std::exp(random.uniform(std::log(low), std::log(high)));
  }
  double sign() { return random.uniform() < 0.5 ? -1 : 1; }
  std::size_t axis() { return static_cast<std::size_t>(random.below(kAxes)); }
  // Three numbers whose largest is `size`, either sign.
  Eigen::Vector3d vector(double size) {
    Eigen::Vector3d v(between(-1, 1), between(-1, 1), between(-1, 1));
    return v * (size / std::max(v.cwiseAbs().maxCoeff(), 1e-6));
  }
  // The same in g. A vector, not an expression of Eigen's: a lambda that captures such an
  // expression refers to a vector that is gone.
  Eigen::Vector3d vector_of_mg(double size_mg) { return vector(size_mg / kMgPerG); }
};

inline Eigen::Matrix3d turn_by(const Eigen::Vector3d& deg) {
  const double angle = deg.norm() * std::numbers::pi / 180;
  return angle < 1e-15 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                       : Eigen::AngleAxisd(angle, deg.normalized()).toRotationMatrix();
}

// A sample number somewhere in the middle half of the recording.
struct Moment {
  double share;
  std::uint64_t sample = 0;
  void in(const RecordingPlan& plan) {
    sample = static_cast<std::uint64_t>(share * static_cast<double>(plan.length()));
  }
};

inline Eigen::Index row(std::size_t axis) { return static_cast<Eigen::Index>(axis); }

template <Made (*kMake)(Draw)>
OutsideKind outside(const char* name, Stage stage, std::string_view family, bool in_faces = true,
                    bool only_by_name = false) {
  EffectKind kind = {name,
                     stage,
                     "outside the catalogue",
                     {{"severity", "1", {1}, 0, 10, "drawn"}},
                     [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
                       return kMake(Draw{values.at("severity")[0], random});
                     }};
  return {std::move(kind), family, in_faces, only_by_name};
}

// gap_outside_serviced.cpp
std::vector<OutsideKind> serviced_kinds();

}  // namespace sixpoint::station::outside_parts
