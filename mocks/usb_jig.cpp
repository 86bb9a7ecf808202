#include "mocks/usb_jig.h"

#include "device/usb_ids.h"
#include "mocks/usb_unit.h"

namespace sixpoint::mocks {

namespace {

UsbDescriptors jig_descriptors(const std::string& serial) {
  const auto low = [](std::uint16_t word) { return static_cast<std::uint8_t>(word & 0xFFU); };
  const auto high = [](std::uint16_t word) { return static_cast<std::uint8_t>(word >> 8U); };
  UsbDescriptors usb;
  usb.device = {18,
                1,
                0x00,
                0x02,
                0,
                0,
                0,
                64,
                low(device::kUsbVendorId),
                high(device::kUsbVendorId),
                low(device::kJigProductId),
                high(device::kJigProductId),
                0x00,
                0x01,
                1,
                2,
                3,
                1};
  usb.strings = {{1, "Sixpoint"}, {2, "Motorised jig"}, {3, serial}};
  usb.hid = {{device::kHidInterface, hid_report_descriptor()}};
  // Self powered, 100 mA; both interrupt endpoints every millisecond.
  usb.configuration = {9,
                       2,
                       41,
                       0,
                       1,
                       1,
                       0,
                       0xC0,
                       50,
                       9,
                       4,
                       0,
                       0,
                       2,
                       3,
                       0,
                       0,
                       0,
                       9,
                       0x21,
                       0x11,
                       0x01,
                       0,
                       1,
                       0x22,
                       static_cast<std::uint8_t>(hid_report_descriptor().size()),
                       0,
                       7,
                       5,
                       device::kHidInEndpoint,
                       3,
                       64,
                       0,
                       4,
                       7,
                       5,
                       device::kHidOutEndpoint,
                       3,
                       64,
                       0,
                       4};
  return usb;
}

}  // namespace

UsbJig::UsbJig(const VirtualHidJigOptions& options, std::shared_ptr<PluggedUnit> turned,
               std::shared_ptr<Clock> clock)
    : StandardUsbDevice(jig_descriptors(options.serial), std::move(clock)),
      physics_(turned == nullptr ? nullptr : std::make_unique<VirtualJig>(std::move(turned))),
      jig_(options, physics_.get()) {}

UsbAnswer UsbJig::own_request(const SetupPacket& setup, std::span<const std::uint8_t> data) {
  constexpr SetupPacket kSetOutputReport = {0x21, 9, 0x0200, device::kHidInterface,
                                            device::kReportBytes};
  if (setup == kSetOutputReport) {
    jig_.take_report(data, clock().elapsed());
    return UsbAnswer::done();
  }
  return UsbAnswer::stall();
}

UsbAnswer UsbJig::take(const UsbEndpoint& /*endpoint*/, std::span<const std::uint8_t> bytes) {
  jig_.take_report(bytes, clock().elapsed());
  return UsbAnswer::done();
}

UsbAnswer UsbJig::give(const UsbEndpoint& /*endpoint*/, std::size_t max_length) {
  const auto report = jig_.next_report();
  if (!report) {
    return UsbAnswer::nothing_yet();
  }
  if (max_length < device::kReportBytes) {
    return {UsbAnswer::Kind::overflow, {}};
  }
  return UsbAnswer::done(Bytes(report->begin(), report->end()));
}

}  // namespace sixpoint::mocks
