// A USB capture (usbmon by tcpdump or Wireshark, USBPcap on Windows) made into a session.
//
// Files: classic pcap of either byte order, with times in micro- or nanoseconds, and pcapng
// (draft-ietf-opsawg-pcapng) with interfaces of any resolution. Link types
// (https://www.tcpdump.org/linktypes.html): 220 (LINKTYPE_USB_LINUX_MMAPPED, header of 64 bytes)
// and 189 (LINKTYPE_USB_LINUX, 48 bytes) as the kernel's Documentation/usb/usbmon.rst describes
// them, and 249 (LINKTYPE_USBPCAP). Interrupt transfers become reports, bulk transfers of the
// vendor interface blocks; what was sent counts when it was submitted, what came when it was
// completed.
#pragma once

#include <optional>
#include <span>

#include "device/session.h"

namespace sixpoint::device {

struct PcapOptions {
  // Which device; without, the first one that sends or gets a whole report of the protocol.
  std::optional<std::uint16_t> bus;
  std::optional<std::uint16_t> device;
};

// bad_data for anything else than such a capture (what it is is said where that can be seen), one
// that contradicts itself, one without a unit in it, and above 2 million packets. A last packet
// that is cut off is left out.
Result<Session> session_from_pcap(std::span<const std::uint8_t> bytes, const PcapOptions& options);

}  // namespace sixpoint::device
