#include "mocks/in_process/virtual_hands.h"

#include <fmt/format.h>

#include "device/corner.h"

namespace sixpoint::mocks {

namespace {

// A turn by a person; a knock is quicker.
constexpr double kTurnByHand_s = 1.5;
constexpr double kKnock_s = 0.15;
constexpr double kKnock_deg = 12;

}  // namespace

Eigen::Vector3d up_of(device::Pose pose) {
  const auto up = device::direction_of(pose);
  return {up[0], up[1], up[2]};
}

void turn_by_hand(PluggedUnit& plugged, const Eigen::Vector3d& up, double tilt_deg,
                  bool half_turned) {
  plugged.unit.turn_to(up, plugged.clock->elapsed(), kTurnByHand_s, tilt_deg, half_turned);
}

void knock_by_hand(PluggedUnit& plugged, const Eigen::Vector3d& up, bool half_turned) {
  const nanoseconds now = plugged.clock->elapsed();
  plugged.unit.turn_to(up, now, kKnock_s, kKnock_deg, half_turned);
  plugged.unit.turn_to(up, now + from_seconds(kKnock_s), kKnock_s, 0, half_turned);
}

Result<std::string> VirtualHands::obey(std::string_view word) {
  const std::lock_guard lock(plugged_->mutex);
  if (word == "knock") {
    knock_by_hand(*plugged_, up_, half_turned_);
    return std::string("the unit was knocked");
  }
  if (word == "swap") {
    SIXPOINT_ASSIGN(FaultPlan plan, parse_fault_plan(R"({"schema": "sixpoint/faults/1",
                      "faults": [{"fault": "swap", "at_s": 0, "seconds": 1}]})"));
    plugged_->faults = FaultInjector(std::move(plan), plugged_->clock->elapsed());
    return std::string("the unit is pulled out; in a second another one is plugged in");
  }
  constexpr std::string_view kTurned = " turned";
  const bool turned = word.ends_with(kTurned);
  const std::string_view name = turned ? word.substr(0, word.size() - kTurned.size()) : word;
  const auto pose = device::parse_pose(name);
  const auto corner = device::parse_corner(name);
  if (!pose && (!corner || turned)) {
    return fail(ErrorCode::usage, fmt::format("'{}' is no word for the hands", printable(word, 40)),
                {}, "+x -x +y -y +z -z and +x+y+z to -x-y-z turn the unit; +x turned; knock; swap");
  }
  const auto up = pose ? device::direction_of(*pose) : device::direction_of(*corner);
  up_ = {up[0], up[1], up[2]};
  half_turned_ = turned;
  turn_by_hand(*plugged_, up_, 0, half_turned_);
  return fmt::format("the unit is turned to {}{}", name,
                     half_turned_ ? ", half a turn about the vertical" : "");
}

}  // namespace sixpoint::mocks
