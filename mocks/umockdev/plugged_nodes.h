// Where a device that was plugged into a umockdev bus (umockdev_bus.h) is found.
//
//   SIXPOINT_ASSIGN(const PluggedNodes nodes, bus.plug_in(device));
//   const int usb_file = open(nodes.usb_node.c_str(), O_RDWR);
#pragma once

#include <string>

namespace sixpoint::mocks {

struct PluggedNodes {
  std::string port;  // "1-1"
  int bus = 0;
  int address = 0;
  std::string usb_node;     // as programs see it: "/dev/bus/usb/001/002"
  std::string hidraw_node;  // empty where the device has no HID interface
};

}  // namespace sixpoint::mocks
