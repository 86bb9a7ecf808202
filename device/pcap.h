// A USB capture (usbmon by tcpdump or Wireshark) made into a session.
//
// Classic pcap of either byte order, with times in micro- or nanoseconds, of link type 220
// (LINKTYPE_USB_LINUX_MMAPPED, header of 64 bytes) or 189 (LINKTYPE_USB_LINUX, 48 bytes), as
// https://www.tcpdump.org/linktypes.html and the kernel's Documentation/usb/usbmon.rst describe
// them. Interrupt transfers become reports, bulk transfers of the vendor interface blocks; what was
// sent counts when it was submitted, what came when it was completed.
#pragma once

#include <optional>
#include <span>

#include "device/session.h"

namespace sixpoint::device {

struct PcapOptions {
  // Which device; without, the first one that sends or gets a whole report of the protocol.
  std::optional<std::uint16_t> bus;
  std::optional<std::uint8_t> device;
};

// bad_data for anything else than such a capture, one that is cut short within a packet's header,
// one without a unit in it, and above 2 million packets.
Result<Session> session_from_pcap(std::span<const std::uint8_t> bytes, const PcapOptions& options);

}  // namespace sixpoint::device
