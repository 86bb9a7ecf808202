#include "device/jig.h"

#include <fmt/format.h>

namespace sixpoint::device {

std::string_view to_string(Pose pose) {
  constexpr std::array<std::string_view, 6> kNames = {"+x", "-x", "+y", "-y", "+z", "-z"};
  const auto index = static_cast<std::size_t>(pose);
  return index < kNames.size() ? kNames[index] : "?";
}

Result<Pose> parse_pose(std::string_view text) {
  for (const Pose pose : kPoses) {
    if (to_string(pose) == text) {
      return pose;
    }
  }
  return fail(ErrorCode::usage, fmt::format("'{}' is no pose", printable(text, 20)), {},
              "use one of +x -x +y -y +z -z: the axis that points up, or down");
}

std::size_t axis_of(Pose pose) { return static_cast<std::size_t>(pose) / 2; }

int sign_of(Pose pose) { return static_cast<std::size_t>(pose) % 2 == 0 ? 1 : -1; }

Pose pose_of(std::size_t axis, int sign) {
  return static_cast<Pose>(axis * 2 + (sign > 0 ? 0 : 1));
}

PerAxis<double> direction_of(Pose pose) {
  PerAxis<double> force_g{};
  force_g[axis_of(pose)] = sign_of(pose);
  return force_g;
}

Status Jig::go_to_half_turned(Pose /*pose*/) {
  return fail(ErrorCode::usage, "this jig does not turn a unit about the vertical", name(),
              "turn the unit by hand (--jig manual)");
}

Status ManualJig::go_to(Pose /*pose*/) { return {}; }
Status ManualJig::go_to_half_turned(Pose /*pose*/) { return {}; }
Result<JigPosition> ManualJig::position() { return JigPosition{std::nullopt, 0, 0.5, {}}; }
Status ManualJig::stop() { return {}; }
Status ManualJig::release() { return {}; }

Status check_jig(Jig& jig) {
  SIXPOINT_ASSIGN(const JigPosition position, jig.position());
  if (!position.fault.empty()) {
    return fail(ErrorCode::device_unavailable,
                fmt::format("the jig stopped: {}", printable(position.fault, 120)), jig.name(),
                "look at the jig, repair a fault, and say that the jig is free (--jig-is-free)");
  }
  return {};
}

}  // namespace sixpoint::device
