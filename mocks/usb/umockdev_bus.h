// The umockdev carrier: USB devices in software behind the real hidapi, libusb and libudev.
//
// umockdev shows programs that were started with its preload library (umockdev-wrapper) another
// /sys and /dev, and hands their ioctls, reads and writes to a handler: here to a UsbDevice
// (usb_device.h). That holds for the test process and for programs that it starts. What the mock
// answers is what Linux 6.1 answers, as far as is known; the same tests run in qemu, where the
// kernel itself answers.
//
//   if (const auto why = UmockdevBus::enter(argv); !why.empty()) { ... return 77; }
//   SIXPOINT_ASSIGN(auto bus, UmockdevBus::make());
//   SIXPOINT_ASSIGN(auto nodes, bus->plug_in(device));
//   ... HotplugWatch, TransportRegistry::open("hid:SERIAL"), a child process ...
//   bus->unplug(nodes.port);
//
// Two departures from the kernel: reports go to whoever reads first, where the kernel gives each
// open file its own; and a device that left keeps its nodes' numbers to itself, as node numbers
// only ever grow.
//
// Functions may be called from any thread. At most one bus exists at a time in a process.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "mocks/usb_device.h"

namespace sixpoint::mocks {

struct PluggedNodes {
  std::string port;  // "1-1"
  int bus = 0;
  int address = 0;
  std::string usb_node;     // as programs see it: "/dev/bus/usb/001/002"
  std::string hidraw_node;  // empty where the device has no HID interface
};

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

  // Into `port` ("1-3"), or the first free one. The device must be plugged in by its own word
  // (UsbDevice::is_plugged); a device that unplugs itself stays visible until unplug(), as a
  // device with a broken plug does. usage where the port is taken.
  Result<PluggedNodes> plug_in(std::shared_ptr<UsbDevice> device, std::string port = {});
  // Transfers under way fail as in the kernel, then the device vanishes. Nothing where the port is
  // empty. The device itself is told, too (UsbDevice::unplug).
  void unplug(const std::string& port);

  // Without permission (mode 000), or with it for everybody (666).
  void allow(const std::string& port, bool allowed);

 private:
  class Impl;
  explicit UmockdevBus(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::mocks
