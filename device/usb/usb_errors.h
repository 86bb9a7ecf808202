// An errno of the operating system about a USB device, as an Error with a hint for people.
//
//   return usb_error(EBUSY, "cannot open the unit", "/dev/hidraw3");
#pragma once

#include <string>

#include "base/result.h"

namespace sixpoint::device {

// The rules that let people reach the devices (packaging/udev), as hints name them.
inline constexpr const char* kDetectionRules = "60-sixpoint-detect.rules";
inline constexpr const char* kAccessRules = "70-sixpoint-access.rules";

// `error_number` is an errno of usbfs or hidraw; `node` the file it is about; `what` begins the
// sentence ("cannot open the unit").
//   EACCES, EPERM            permission, and the udev rules to install
//   EBUSY                    device_unavailable: another program holds it
//   ENODEV, ENOENT, ENXIO, ESHUTDOWN   device_unavailable: it is gone
//   EPIPE                    io: the endpoint stalled
//   ETIMEDOUT                io: it did not take the bytes in time
//   EOVERFLOW                bad_data: it sent more than an endpoint may
//   anything else            io
tl::unexpected<Error> usb_error(int error_number, const std::string& what, const std::string& node);

}  // namespace sixpoint::device
