#include "mocks/usb/usb_jig.h"

#include "device/usb/usb_ids.h"

namespace sixpoint::mocks {

namespace {

UsbDescriptors jig_descriptors(const std::string& serial) {
  DescriptorBuilder usb(device::kJigProductId, "Motorised jig", serial);
  usb.add_hid_interface();
  return usb.take();
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
