#include "mocks/firmware/pose_history.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sixpoint::mocks {

namespace {

constexpr std::uint64_t kSeatingStream = 0x73656174;

}  // namespace

PoseHistory::PoseHistory(double gravity_g, double seating_deg, std::uint64_t seed)
    : gravity_g_(gravity_g), seating_deg_(seating_deg), random_(seed, kSeatingStream) {
  pose_ = seated(Eigen::Vector3d::UnitZ(), 0, false);
  turns_.push_back({-1, 0, sim::still(pose_, gravity_g_)});
}

void PoseHistory::at(double time_s, sim::MotionState& state) {
  auto turn = std::upper_bound(turns_.begin(), turns_.end(), time_s,
                               [](double t, const Turn& later) { return t < later.start_s; });
  if (turn != turns_.begin()) {
    --turn;
  }
  turn->motion->at(time_s - turn->start_s, state);
}

void PoseHistory::turn_to(const Eigen::Vector3d& up, double now_s, double duration_s,
                          double tilt_deg, bool half_turned) {
  sim::MotionState from;
  at(now_s, from);
  pose_ = seated(up, tilt_deg, half_turned);
  turns_.push_back(
      {now_s, duration_s, sim::turn(from.rotation, pose_, duration_s, random_.bits(), gravity_g_)});
}

void PoseHistory::stop(double now_s) {
  sim::MotionState state;
  at(now_s, state);
  pose_ = state.rotation;
  turns_.push_back({now_s, 0, sim::still(pose_, gravity_g_)});
}

bool PoseHistory::is_turning(double now_s) const {
  return now_s < turns_.back().start_s + turns_.back().duration_s;
}

Eigen::Matrix3d PoseHistory::seated(const Eigen::Vector3d& up, double tilt_deg, bool half_turned) {
  Eigen::Matrix3d pose = sim::rotation_with_up(up);
  if (half_turned) {
    pose.leftCols<2>() *= -1;  // right, away from the person: now left, towards him
  }
  const double rad = std::numbers::pi / 180;
  const Eigen::Vector3d scatter =
      seating_deg_ * rad * Eigen::Vector3d(random_.normal(), random_.normal(), 0);
  const double direction = random_.uniform(0, 2 * std::numbers::pi);
  const Eigen::Vector3d tilt =
      tilt_deg * rad * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0);
  const Eigen::Vector3d both = scatter + tilt;
  return both.norm() == 0
             ? pose
             : Eigen::Matrix3d(pose * Eigen::AngleAxisd(both.norm(), both.normalized()));
}

}  // namespace sixpoint::mocks
