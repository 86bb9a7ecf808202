// 64-byte reports of one HID interface, by hidapi over the kernel's hidraw.
//
//   Result<std::unique_ptr<Transport>> reports = open_hid_transport("/dev/hidraw3");
//
// Two threads per device: one reads all the time, so that no report is lost while the program
// computes (hidraw keeps only 64), one writes, because a hidraw write cannot be interrupted and a
// device that takes nothing holds it for seconds. Destruction takes less than 60 ms, whatever the
// device does.
#pragma once

#include <memory>
#include <string>

#include "device/transport.h"

namespace sixpoint::device {

struct HidTransportOptions {
  // Reports that wait to be read; more are lost, as in the kernel. 4 minutes at 100 Hz.
  std::size_t waiting_reports = 4096;
  // How often the reader checks whether it must end.
  std::chrono::milliseconds slice{20};
};

// `node` as in AttachedDevice::hidraw_node. Reports without report ids. Time-outs are real time.
// Errors: those of usb_error() (usb_errors.h).
Result<std::unique_ptr<Transport>> open_hid_transport(const std::string& node,
                                                      HidTransportOptions options = {});

}  // namespace sixpoint::device
