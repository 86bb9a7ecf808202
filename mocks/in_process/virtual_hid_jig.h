// The motorised jig in software: the firmware that answers docs/devices/motorised-jig.md, over a
// jig that turns a virtual unit (virtual_jig.h), or over nothing but time.
//
// No input or output of its own, as virtual_unit.h: a carrier hands it reports and asks it for
// replies. link_to_jig() is the in-process carrier, and "virtual:SETTING,..." as a jig's address is
// its scheme:
//   serial, fault (a code of the page, such as obstructed), fault_at (the turn at which it comes, 1
//   the first; 3), lie_deg (it ends so far off and reports none of it), wrong_pose_at (at this turn
//   it goes elsewhere and reports the pose that was asked for), uncertainty_deg.
#pragma once

#include <memory>
#include <string_view>

#include "device/hid_jig.h"
#include "device/jig_registry.h"
#include "mocks/virtual_jig.h"

namespace sixpoint::mocks {

struct VirtualHidJigOptions {
  std::string serial = "J600001";
  device::JigFault fault = device::JigFault::none;
  int fault_at = 3;
  double lie_deg = 0;
  int wrong_pose_at = 0;
  double uncertainty_deg = 0.05;
};
Result<VirtualHidJigOptions> parse_virtual_hid_jig(std::string_view text);  // usage

class VirtualHidJig {
 public:
  // `physics` turns the unit and outlives this; null: it turns in two seconds, by itself.
  VirtualHidJig(VirtualHidJigOptions options, VirtualJig* physics);

  void take_report(std::span<const std::uint8_t> report, std::chrono::nanoseconds now);
  std::optional<device::Report> next_report();
  device::JigState state(std::chrono::nanoseconds now);

 private:
  device::Message answer(const device::Message& request, std::chrono::nanoseconds now);
  device::ReplyCode turn_to(device::Pose pose, std::chrono::nanoseconds now);

  VirtualHidJigOptions options_;
  VirtualJig* physics_;
  device::JigMotion motion_ = device::JigMotion::unknown;
  std::optional<device::Pose> pose_;
  std::chrono::nanoseconds turned_at_{0};
  int turns_ = 0;
  std::optional<device::Message> last_request_;
  device::Report last_reply_{};
  std::deque<device::Report> replies_;
};

// The link to such a jig. Both what it shares and `physics` must outlive it.
device::Link link_to_jig(std::shared_ptr<VirtualHidJig> jig, std::shared_ptr<Clock> clock);

// Registers "virtual:" for jigs, over the jig that is part of a virtual unit.
void register_virtual_hid_jig(device::JigRegistry& registry);

}  // namespace sixpoint::mocks
