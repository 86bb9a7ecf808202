// Devices that come and go.
//
//   SIXPOINT_ASSIGN(auto watch, HotplugWatch::start());
//   SIXPOINT_ASSIGN(auto event, watch->next(std::chrono::seconds(1)));
//
// Devices that are plugged in at the start are reported as arrived. After that an event of the
// kernel only starts a scan, and the difference to the last scan is reported: a lost event, or a
// machine without udevd, costs one second. A device that comes back under another node, and another
// device in the same port, are one departure and one arrival.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "device/usb/discovery.h"

namespace sixpoint::device {

struct HotplugEvent {
  enum class Kind { arrived, left };
  Kind kind = Kind::arrived;
  AttachedDevice device;  // as it was found at its arrival
};

// Whether what is seen now is the device that is known:
//
//     port and nodes     serial number            it is
//     one is another     -                        another device
//     the same           the same                 that device
//     the same           none: the kernel takes   that device, which is about to leave
//                        it away with the others
//     the same           another                  another device
bool is_still(const AttachedDevice& known, const AttachedDevice& seen);

// One thread at a time, except cancel().
class HotplugWatch {
 public:
  static Result<std::unique_ptr<HotplugWatch>> start(DiscoveryFilter filter = {});
  ~HotplugWatch();
  HotplugWatch(const HotplugWatch&) = delete;
  HotplugWatch& operator=(const HotplugWatch&) = delete;

  // A device has arrived when all its nodes are there (AttachedDevice::complete). Empty when
  // nothing happened in time (real time), or after cancel().
  Result<std::optional<HotplugEvent>> next(std::chrono::nanoseconds time_out);
  // Ends a next() that waits, and all later ones.
  void cancel();

 private:
  struct Monitor;
  HotplugWatch(DiscoveryFilter filter, std::unique_ptr<Monitor> monitor);
  Status scan();

  DiscoveryFilter filter_;
  std::unique_ptr<Monitor> monitor_;
  std::vector<AttachedDevice> known_;
  std::deque<HotplugEvent> events_;
};

}  // namespace sixpoint::device
