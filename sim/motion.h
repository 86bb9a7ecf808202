// Motion: where a unit is, and what acts on it, as a function of time.
//
//   auto motion = still(rotation_with_up({0, 0, 1}));
//   MotionState state;
//   motion->at(0.5, state);
//
// The laboratory's frame has z up; the specific force of a unit at rest is (0, 0, gravity).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <vector>

#include "sim/effects/effect.h"

namespace sixpoint::sim {

class Motion {
 public:
  virtual ~Motion() = default;
  // Cheapest when times rise from call to call; any order is right.
  virtual void at(double time_s, MotionState& state) = 0;
};

// A rotation under which `direction` (sensor's frame, any length but 0) points up.
Eigen::Matrix3d rotation_with_up(const Eigen::Vector3d& direction);

std::unique_ptr<Motion> still(const Eigen::Matrix3d& rotation, double gravity_g = 1);

// From one pose to another, smoothly, within `duration_s`, with a person's tremor of 0.05 g between
// 3 and 9 Hz, which fades in and out; at rest before and after.
std::unique_ptr<Motion> turn(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to,
                             double duration_s, std::uint64_t seed, double gravity_g = 1);

std::unique_ptr<Motion> shaker(const Eigen::Matrix3d& rotation, const Tone& tone,
                               double gravity_g = 1);

// Something like a day: bouts at rest in many directions (about 40 % of the time) and bouts of
// movement up to several g, drawn from the seed.
std::unique_ptr<Motion> free_living(double duration_s, std::uint64_t seed, double gravity_g = 1);

// One after another. Beyond the end the last one goes on.
class MotionSequence final : public Motion {
 public:
  void add(std::unique_ptr<Motion> motion, double duration_s);
  double duration_s() const { return parts_.empty() ? 0 : parts_.back().end_s; }
  void at(double time_s, MotionState& state) override;

 private:
  struct Part {
    std::unique_ptr<Motion> motion;
    double start_s;
    double end_s;
  };
  std::vector<Part> parts_;
  std::size_t last_ = 0;
};

}  // namespace sixpoint::sim
