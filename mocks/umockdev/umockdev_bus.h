// The umockdev carrier: USB devices in software behind the real hidapi, libusb and libudev.
//
//   if (const std::string why = UmockdevBus::enter(argv); !why.empty()) {
//     return fail(ErrorCode::device_unavailable, why);  // skip the test
//   }
//   SIXPOINT_ASSIGN(const auto bus, UmockdevBus::make());
//   SIXPOINT_ASSIGN(const PluggedNodes nodes, bus->plug_in(device));
//   SIXPOINT_ASSIGN(const auto found, device::attached_devices());
//   bus->unplug(nodes.port);
//
// umockdev gives programs that were started with its preload library (umockdev-wrapper) another
// /sys and /dev, and passes their ioctls, reads and writes to a handler: here to a UsbDevice
// (usb_device.h). It does so in the test process and in programs that it starts. The mock answers
// as Linux 6.1 does; the same tests run in qemu, where the kernel itself answers.
//
// Two departures from the kernel: a report goes to the first reader, where the kernel gives one to
// each open file; and the numbers of nodes are never used again.
//
// Functions may be called from any thread. At most one bus exists at a time in a process.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "mocks/umockdev/plugged_nodes.h"
#include "mocks/usb/usb_device.h"

namespace sixpoint::mocks {

class UmockdevBus {
 public:
  // Starts this program again with the preload library; to be called first in main(). Returns when
  // the process has it, with an empty string, or when it cannot be had, with a line that names the
  // package (a test then ends with 77).
  static std::string enter(char** argv);

  static Result<std::unique_ptr<UmockdevBus>> make();
  ~UmockdevBus();
  UmockdevBus(const UmockdevBus&) = delete;
  UmockdevBus& operator=(const UmockdevBus&) = delete;

  // Into `port` ("1-3"), or the first free one. A device that unplugs itself
  // (UsbDevice::is_plugged) stays visible until unplug(), as a device with a broken plug does.
  // usage where the port is taken.
  Result<PluggedNodes> plug_in(std::shared_ptr<UsbDevice> device, std::string port = {});
  // Pending transfers fail as in the kernel, then the device vanishes. Calls UsbDevice::unplug().
  // Does nothing where the port is empty.
  void unplug(const std::string& port);

  // Without permission (mode 000), or with it for all users (666).
  void allow(const std::string& port, bool allowed);

 private:
  class Impl;
  explicit UmockdevBus(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::mocks
