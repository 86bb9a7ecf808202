// Messages of a USB/IP client, by Linux, Documentation/usb/usbip_protocol.rst.
#pragma once

#include "device/wire/protocol.h"
#include "usbip_client.h"

namespace sixpoint::tests {

// A request of the units' own protocol, as the data of a transfer.
inline UsbipClient::Data request_report(device::Command command, std::uint16_t sequence,
                                        Bytes payload = {}) {
  const auto report =
      device::encode({device::ReportKind::request, sequence, command, {}, std::move(payload)});
  return {report.begin(), report.end()};
}

// USBIP_CMD_SUBMIT of the first device, without a setup packet.
inline UsbipClient::Data submit_header(std::uint32_t command, std::uint32_t direction,
                                       std::uint32_t endpoint, std::uint32_t length,
                                       std::uint32_t packets) {
  UsbipClient::Data bytes;
  for (const std::uint32_t word :
       {command, 1U, 0x00010002U, direction, endpoint, 0U, length, 0U, packets, 0U, 0U, 0U}) {
    UsbipClient::put(bytes, word, 4);
  }
  return bytes;
}

}  // namespace sixpoint::tests
