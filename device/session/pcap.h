// Makes a session of a USB capture (usbmon by tcpdump or Wireshark, USBPcap on Windows).
//
//   Result<Session> session = session_from_pcap(file_content, {.bus = 3, .device = 9});
//
// Read: the file form pcap (draft-ietf-opsawg-pcap) of either byte order, with times in micro- or
// nanoseconds. Not read: pcapng; `editcap -F pcap` converts it.
// Link types (https://www.tcpdump.org/linktypes.html): 220 (LINKTYPE_USB_LINUX_MMAPPED, header of
// 64 bytes) and 189 (LINKTYPE_USB_LINUX, 48 bytes), see the kernel's Documentation/usb/usbmon.rst,
// and 249 (LINKTYPE_USBPCAP). Interrupt transfers become reports, bulk transfers of the vendor
// interface become blocks. Output counts when it was submitted, input when it was completed.
#pragma once

#include <optional>
#include <span>

#include "device/session/session.h"

namespace sixpoint::device {

struct PcapOptions {
  // The device. Where one of the two is missing: the first one with the other that sends or gets a
  // whole report of the protocol.
  std::optional<std::uint16_t> bus;
  std::optional<std::uint16_t> device;
};

// bad_data for another form or link type (the message names it), for a capture that contradicts
// itself, that has no unit in it, or more than 2 million packets. A last packet that is cut off is
// left out.
Result<Session> session_from_pcap(std::span<const std::uint8_t> bytes, const PcapOptions& options);

}  // namespace sixpoint::device
