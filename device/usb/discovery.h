// Which devices are plugged in, as the kernel lists them (udev, sysfs).
//
//   SIXPOINT_ASSIGN(const std::vector<AttachedDevice> found, attached_devices());
//   for (const AttachedDevice& one : found) {
//     std::cout << one.serial << " in port " << one.port << '\n';
//   }
//
// Nothing is opened: this needs no permission to use a device and does not disturb a program that
// uses it. Safe from any thread.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/env.h"
#include "device/transport.h"
#include "device/usb/usb_ids.h"

namespace sixpoint::device {

struct AttachedDevice {
  std::uint16_t vendor_id = 0;
  std::uint16_t product_id = 0;
  std::string model;   // out of kUsbProducts; empty for others
  std::string serial;  // of the device descriptor, printable ASCII; empty where it has none
  std::string port;    // the socket, as the kernel names it: "1-2.3" is port 3 of a hub in port 2
  int bus = 0;
  int address = 0;          // on that bus; another one after every plugging in
  std::string usb_node;     // "/dev/bus/usb/001/004"
  std::string hidraw_node;  // "/dev/hidraw3"; empty without a HID interface, or before the kernel
                            // has made it

  // True when every node that this product needs is there.
  bool complete() const;
};

struct DiscoveryFilter {
  std::uint16_t vendor_id = kUsbVendorId;
  // Empty: every product of the vendor.
  std::vector<std::uint16_t> product_ids = {kMonitorProductId};
  std::string serial = {};  // empty: any
};

// In the order of their ports. Empty also on a machine without USB. io when udev cannot be asked.
Result<std::vector<AttachedDevice>> attached_devices(const DiscoveryFilter& filter = {});

// The one device that `serial` names; with an empty serial the only one there is. Waits up to half
// a second for nodes that the kernel is still making. device_unavailable when there is none or two
// have that serial, usage when the serial is empty and there are several.
Result<AttachedDevice> find_device(const DiscoveryFilter& filter, Clock& clock);

// Whether this process may use the device's nodes, without opening them. permission names the udev
// rules; device_unavailable when a node is not there. The nodes of a file monitor belong to the
// operating system and are not checked.
Status check_access(const AttachedDevice& device);

// Where the volume of a device with mass storage is mounted; empty where it is not. io when udev
// cannot be asked.
Result<std::string> mount_point(const AttachedDevice& device);

// Opens both channels of a monitor. The claimed bulk interface is what keeps a second program out.
Result<Link> open_monitor(const AttachedDevice& monitor, Env& env);

// Registers "hid:SERIAL" and "usb:SERIAL". Both open the composite unit: reports by hidapi, bulk by
// libusb; the two names mean the same. Without SERIAL: the only unit.
void register_usb(TransportRegistry& registry);

}  // namespace sixpoint::device
