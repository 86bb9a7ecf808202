#include "mocks/in_process/virtual_jig.h"

#include <cmath>
#include <numbers>
#include <utility>

namespace sixpoint::mocks {

namespace {

constexpr double kTurnByMotor_s = 1.5;

}  // namespace

Status VirtualJig::turn(device::Pose pose, bool half_turned) {
  auto up = device::direction_of(pose);
  // The jig leans where it leans: a unit that lies the other way round leans the other way.
  up[(device::axis_of(pose) + 1) % kAxes] =
      (half_turned ? -1 : 1) * std::tan(lean_deg_[pose] * std::numbers::pi / 180);
  SIXPOINT_CHECK(turn_to(up, half_turned));
  pose_ = pose;
  return {};
}

Status VirtualJig::go_to_corner(const device::Corner& corner) {
  SIXPOINT_CHECK(turn_to(device::direction_of(corner), false));
  pose_.reset();
  return {};
}

Status VirtualJig::turn_to(const PerAxis<double>& up, bool half_turned) {
  const std::lock_guard lock(plugged_->mutex);
  if (plugged_->motor.stopped) {
    return fail(ErrorCode::device_unavailable, "the jig stopped: emergency stop", name(),
                "look at the jig; when no hand is in it, say that it is free");
  }
  plugged_->motor.begin_movement();
  plugged_->unit.turn_to({up[0], up[1], up[2]}, plugged_->clock->elapsed(), kTurnByMotor_s,
                         std::exchange(tilt_next_deg_, 0.0), half_turned);
  return {};
}

Result<device::JigPosition> VirtualJig::position() {
  const std::lock_guard lock(plugged_->mutex);
  device::JigPosition position;
  position.angle_uncertainty_deg = 0.02;
  if (!plugged_->unit.is_turning(plugged_->clock->elapsed())) {
    position.pose = pose_;
  }
  if (plugged_->motor.stopped) {
    position.fault = "emergency stop";
  }
  return position;
}

Status VirtualJig::stop() {
  const std::lock_guard lock(plugged_->mutex);
  const auto now = plugged_->clock->elapsed();
  if (plugged_->unit.is_turning(now)) {
    plugged_->unit.stop_turning(now);
    pose_.reset();  // somewhere in between
  }
  plugged_->motor.stop();
  return {};
}

Status VirtualJig::release() {
  const std::lock_guard lock(plugged_->mutex);
  plugged_->motor.stopped = false;
  return {};
}

}  // namespace sixpoint::mocks
