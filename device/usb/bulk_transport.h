// One vendor bulk interface, by libusb.
//
//   auto bulk = open_bulk_transport({.bus = 1, .address = 4}, "/dev/bus/usb/001/004");
//
// While the program reads, several transfers are under way at once, so that the bus does not wait
// for the program; a thread collects them. It starts with the first transfer and ends in less than
// 40 ms, so that both channels of a unit are closed in 100 ms.
#pragma once

#include <memory>
#include <string>

#include "device/transport.h"

namespace sixpoint::device {

struct BulkTransportOptions {
  // Each 16 KiB: 128 KiB under way are 3 ms of a high-speed bus, and below usbfs' limit of 16 MB
  // for a hundred units.
  int transfers = 8;
};

struct UsbLocation {
  int bus = 0;
  int address = 0;
};

// Claims the bulk interface (usb_ids.h): a second program gets device_unavailable. `node` is named
// in errors. read() delivers what one short-packet-terminated transfer brought. A stalled endpoint
// is io, once: the halt is cleared, and the caller may repeat its request. Time-outs are real time.
Result<std::unique_ptr<Transport>> open_bulk_transport(UsbLocation location,
                                                       const std::string& node,
                                                       BulkTransportOptions options = {});

}  // namespace sixpoint::device
