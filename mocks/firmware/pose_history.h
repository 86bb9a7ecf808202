// The pose of a virtual unit as a function of time: all turns so far.
//
//   PoseHistory poses(1.0, 0.01, 7);
//   poses.turn_to({1, 0, 0}, 0.0, 1.5, 0);  // +x up, in 1.5 s
//   sim::MotionState state;
//   poses.at(0.7, state);  // in the middle of the turn
//
// Every placement has a seating scatter of its own, drawn from the seed. Times in seconds since the
// carrier's clock began; turns are added in the order of their times.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/random.h"
#include "sim/motion.h"

namespace sixpoint::mocks {

class PoseHistory final : public sim::Motion {
 public:
  // `seating_deg`: standard deviation per axis.
  PoseHistory(double gravity_g, double seating_deg, std::uint64_t seed);

  void at(double time_s, sim::MotionState& state) override;
  // `tilt_deg`: how far the pose ends off, in a random direction. `half_turned`: about the
  // vertical, from sim::rotation_with_up(up).
  void turn_to(const Eigen::Vector3d& up, double now_s, double duration_s, double tilt_deg,
               bool half_turned = false);
  void stop(double now_s);
  bool is_turning(double now_s) const;

 private:
  struct Turn {
    double start_s;
    double duration_s;
    std::unique_ptr<sim::Motion> motion;
  };
  Eigen::Matrix3d seated(const Eigen::Vector3d& up, double tilt_deg, bool half_turned);

  double gravity_g_;
  double seating_deg_;
  Random random_;
  Eigen::Matrix3d pose_ = Eigen::Matrix3d::Identity();
  std::vector<Turn> turns_;
};

}  // namespace sixpoint::mocks
