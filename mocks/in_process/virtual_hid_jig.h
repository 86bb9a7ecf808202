// The motorised jig in software: the firmware that answers docs/devices/motorised-jig.md, over a
// jig that turns a virtual unit (virtual_jig.h), or over nothing but time.
//
//   auto jig = std::make_shared<VirtualHidJig>(VirtualHidJigOptions{}, nullptr);
//   auto opened = device::HidJig::open(link_to_jig(jig, clock));
//
// It has no input or output of its own, as virtual_unit.h: a carrier gives it reports and takes
// replies. link_to_jig() is the in-process carrier. The address of such a jig is
// "virtual:SETTING,...":
//   serial, fault (a code of the page, such as obstructed), fault_at (the turn at which it comes,
//   from 1; 3), lie_deg (it ends so far off and does not report it), wrong_pose_at (at this turn it
//   goes to another pose and reports the one that was asked for), uncertainty_deg, stop_at (at this
//   turn its red button is pressed), stopped (1: the button was pressed before), lean_deg (its base
//   is not level: all poses lean so far towards the unit's next axis), worn (a pose that leans
//   worn_deg more; 0.3). The encoder sees neither.
#pragma once

#include <memory>
#include <string_view>

#include "device/jig_registry.h"
#include "device/jigs/hid_jig.h"
#include "mocks/firmware/reply_queue.h"
#include "mocks/in_process/virtual_jig.h"

namespace sixpoint::mocks {

struct VirtualHidJigOptions {
  std::string serial = "J600001";
  device::JigFault fault = device::JigFault::none;
  int fault_at = 3;
  double lie_deg = 0;
  int wrong_pose_at = 0;
  double uncertainty_deg = 0.05;
  int stop_at = 0;
  bool stopped = false;
  double lean_deg = 0;
  std::optional<device::Pose> worn = {};
  double worn_deg = 0.3;
};
Result<VirtualHidJigOptions> parse_virtual_hid_jig(std::string_view text);  // usage

class VirtualHidJig {
 public:
  // `physics` turns the unit and outlives this; null: it turns in two seconds, by itself.
  VirtualHidJig(VirtualHidJigOptions options, VirtualJig* physics);

  void take_report(std::span<const std::uint8_t> report, std::chrono::nanoseconds now);
  std::optional<device::Report> next_report();
  device::JigState state(std::chrono::nanoseconds now);
  void press_stop();  // its red button

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
  ReplyQueue replies_;
};

// The link to such a jig. Both what it shares and `physics` must outlive it.
device::Link link_to_jig(std::shared_ptr<VirtualHidJig> jig, std::shared_ptr<Clock> clock);

// Registers "virtual:" for jigs, over the jig that is part of a virtual unit.
void register_virtual_hid_jig(device::JigRegistry& registry);

}  // namespace sixpoint::mocks
