// Building blocks of the kinds outside the catalogue (outside.h), for those files only.
//
//   Made step(Draw draw) {
//     const Eigen::Vector3d step_g = draw.vector_of_mg(2 * draw.severity);
//     return acting_from(0.5, [step_g](Eigen::Vector3d& sensed) { sensed += step_g; });
//   }
//   OutsideKind step_kind() { return outside("step", Stage::sensor, step, "offset"); }
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string_view>
#include <vector>

#include "base/random.h"
#include "gap/challenge/outside.h"
#include "sim/effects/parts.h"

namespace sixpoint::gap::outside_parts {

using sim::acting_at;
using sim::added_effect;
using sim::Effect;
using sim::motion_effect;
using sim::ParameterSet;
using sim::Parts;
using sim::Placement;
using sim::RecordingPlan;
using sim::sensed_effect;
using sim::SimulatedBlock;
using sim::Stage;
using sim::stored_effect;

inline constexpr double kTwoPi = 2 * std::numbers::pi;

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
  // The same in g. A vector, not an expression of Eigen's, which would refer to a temporary.
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

// Changes the specific force, in g, from a share of the recording on: change(sensed).
template <class Change>
Made acting_from(double share, Change change) {
  auto made = std::make_unique<Parts>();
  auto moment = std::make_shared<Moment>(Moment{share});
  made->recording = [moment](const RecordingPlan& plan) { moment->in(plan); };
  made->sensor = [moment, change](SimulatedBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (block.first_sample + i >= moment->sample) {
        change(block.sensed_g[i]);
      }
    }
  };
  return made;
}

// Moves each sample by the sum of step_s(time_s) so far, which starts anew with the sample clock.
template <class Step>
Made shifted_effect(Step step_s) {
  return acting_at(&Parts::sampling,
                   [step_s, shift_s = 0.0, start_s = -1.0](SimulatedBlock& block) mutable {
                     if (block.clock_start_s != start_s) {
                       start_s = block.clock_start_s;
                       shift_s = 0;
                     }
                     for (double& t : block.time_s) {
                       shift_s += step_s(t);
                       t += shift_s;
                     }
                   });
}

inline Eigen::Index row(std::size_t axis) { return static_cast<Eigen::Index>(axis); }

// `family` and `in_faces` as OutsideKind has them.
inline OutsideKind outside(const char* name, Stage stage, Made (*make)(Draw),
                           std::string_view family = "", bool in_faces = true) {
  sim::EffectKind kind = {name,
                          stage,
                          "outside the catalogue",
                          {{"severity", "1", {1}, 0, 10, "drawn"}},
                          [make](const ParameterSet& values, Random random) {
                            return make(Draw{values.at("severity")[0], random});
                          }};
  return {std::move(kind), family, in_faces};
}

// outside_serviced.cpp
std::vector<OutsideKind> serviced_kinds();

}  // namespace sixpoint::gap::outside_parts
