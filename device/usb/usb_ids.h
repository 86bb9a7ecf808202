// The USB ids of the project's own devices. This is their only place in the code.
//
//   const bool is_monitor = device.product_id == kMonitorProductId;
//
// 0x1209 is the vendor id of pid.codes; its product ids 0x0001 to 0x0010 are for private testing
// and not for hardware on sale. A builder of devices changes these constants and the same numbers
// in packaging/udev/60-sixpoint-detect.rules (a test compares the two); see docs/devices.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace sixpoint::device {

inline constexpr std::uint16_t kUsbVendorId = 0x1209;

struct UsbProduct {
  std::uint16_t product_id;
  std::string_view model;  // as docs/devices names it
};

// An activity monitor on the bench: HID, vendor bulk and mass storage (docs/protocol.md).
inline constexpr std::uint16_t kMonitorProductId = 0x0001;
// A jig with a motor, over HID.
inline constexpr std::uint16_t kJigProductId = 0x0002;
// A monitor that offers mass storage and nothing else, calibrated by files.
inline constexpr std::uint16_t kFileMonitorProductId = 0x0003;

inline constexpr std::array<UsbProduct, 3> kUsbProducts = {{
    {kMonitorProductId, "wgt3x-bt-bench-unit"},
    {kJigProductId, "motorised-jig"},
    {kFileMonitorProductId, "file-monitor"},
}};

// Interfaces of the monitor.
inline constexpr int kHidInterface = 0;
inline constexpr int kBulkInterface = 1;
inline constexpr int kStorageInterface = 2;

inline constexpr std::uint8_t kHidInEndpoint = 0x81;
inline constexpr std::uint8_t kHidOutEndpoint = 0x01;
inline constexpr std::uint8_t kBulkInEndpoint = 0x82;
inline constexpr std::uint8_t kBulkOutEndpoint = 0x02;
inline constexpr std::uint8_t kStorageInEndpoint = 0x83;
inline constexpr std::uint8_t kStorageOutEndpoint = 0x03;

}  // namespace sixpoint::device
