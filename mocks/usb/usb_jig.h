// The virtual motorised jig as a USB device: one HID interface, 64-byte reports in and out
// (docs/devices/motorised-jig.md).
//
//   UsbJig jig(VirtualHidJigOptions{}, plugged, clock);
#pragma once

#include <memory>

#include "mocks/in_process/virtual_hid_jig.h"
#include "mocks/usb/usb_device.h"

namespace sixpoint::mocks {

class UsbJig final : public StandardUsbDevice {
 public:
  // `turned` is the unit that the jig turns; null: none, and time passes on `clock` all the same.
  UsbJig(const VirtualHidJigOptions& options, std::shared_ptr<PluggedUnit> turned,
         std::shared_ptr<Clock> clock);

 private:
  UsbAnswer own_request(const SetupPacket& setup, std::span<const std::uint8_t> data) override;
  UsbAnswer take(const UsbEndpoint& endpoint, std::span<const std::uint8_t> bytes) override;
  UsbAnswer give(const UsbEndpoint& endpoint, std::size_t max_length) override;

  std::unique_ptr<VirtualJig> physics_;
  VirtualHidJig jig_;
};

}  // namespace sixpoint::mocks
