// A jig that turns a virtual unit, and misses the pose when a test asks for it.
//
//   VirtualJig jig(plugged);  // in_process.h
//   jig.tilt_next(3);         // the next pose ends 3 degrees off
//   Status turning = jig.go_to(device::Pose::plus_x);
#pragma once

#include <map>
#include <memory>

#include "device/corner.h"
#include "device/jig.h"
#include "mocks/in_process/in_process.h"

namespace sixpoint::mocks {

class VirtualJig final : public device::Jig, public device::CornerJig {
 public:
  explicit VirtualJig(std::shared_ptr<PluggedUnit> plugged) : plugged_(std::move(plugged)) {}

  std::string name() const override { return "virtual"; }
  bool turns_by_itself() const override { return true; }
  Status go_to(device::Pose pose) override { return turn(pose, false); }
  // As no motorised jig that is known does: so that the whole of `production+` can be tested.
  bool can_half_turn() const override { return true; }
  Status go_to_half_turned(device::Pose pose) override { return turn(pose, true); }
  Status go_to_corner(const device::Corner& corner) override;
  Result<device::JigPosition> position() override;
  Status stop() override;
  Status release() override;

  // What it turns.
  const std::shared_ptr<PluggedUnit>& plugged() const { return plugged_; }
  // The next placement ends this far off, in a random direction.
  void tilt_next(double tilt_deg) { tilt_next_deg_ = tilt_deg; }
  // From now on every placement in this pose leans so far towards the next axis (x, y, z, x): a
  // base that is not level, or a worn face.
  void set_lean(device::Pose pose, double lean_deg) { lean_deg_[pose] = lean_deg; }

 private:
  Status turn(device::Pose pose, bool half_turned);
  Status turn_to(const PerAxis<double>& up, bool half_turned);

  std::shared_ptr<PluggedUnit> plugged_;
  std::optional<device::Pose> pose_;
  double tilt_next_deg_ = 0;
  std::map<device::Pose, double> lean_deg_;
};

}  // namespace sixpoint::mocks
