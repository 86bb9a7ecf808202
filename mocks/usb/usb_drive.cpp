#include "mocks/usb_drive.h"

#include "device/usb_ids.h"

namespace sixpoint::mocks {

namespace {

constexpr const char* kProductName = "File monitor";

UsbDescriptors drive_descriptors(const std::string& serial) {
  const auto low = [](std::uint16_t word) { return static_cast<std::uint8_t>(word & 0xFFU); };
  const auto high = [](std::uint16_t word) { return static_cast<std::uint8_t>(word >> 8U); };
  const std::uint16_t vendor = device::kUsbVendorId;
  const std::uint16_t product = device::kFileMonitorProductId;
  UsbDescriptors usb;
  usb.device = {
      18,   1,    0x00, 0x02, 0, 0, 0, 64, low(vendor), high(vendor), low(product), high(product),
      0x00, 0x01, 1,    2,    3, 1};
  usb.strings = {{1, "Sixpoint"}, {2, kProductName}, {3, serial}, {4, "Recordings"}};
  // Self powered, 100 mA; SCSI over bulk only, two endpoints of 512 bytes.
  usb.configuration = {9, 2, 32, 0, 1, 1, 0, 0xC0, 50};
  const Bytes interface = {9, 4, UsbDrive::kInterface, 0, 2, 8, 6, 0x50, 4};
  const Bytes in = {7, 5, device::kStorageInEndpoint, 2, 0x00, 0x02, 0};
  const Bytes out = {7, 5, device::kStorageOutEndpoint, 2, 0x00, 0x02, 0};
  for (const Bytes& part : {interface, in, out}) {
    usb.configuration.insert(usb.configuration.end(), part.begin(), part.end());
  }
  return usb;
}

}  // namespace

UsbDrive::UsbDrive(const sim::UnitTruth& truth, std::shared_ptr<const BlockMedium> volume,
                   std::shared_ptr<Clock> clock)
    : StorageUsbDevice(drive_descriptors(truth.serial), std::move(clock),
                       {.product = kProductName, .serial = truth.serial}) {
  storage_.insert(std::move(volume));
}

UsbAnswer UsbDrive::own_request(const SetupPacket& setup, std::span<const std::uint8_t> /*data*/) {
  return storage_.request(setup, kInterface);
}

UsbAnswer UsbDrive::take(const UsbEndpoint& /*endpoint*/, std::span<const std::uint8_t> bytes) {
  return take_storage(bytes);
}

UsbAnswer UsbDrive::give(const UsbEndpoint& /*endpoint*/, std::size_t max_length) {
  return give_storage(max_length);
}

}  // namespace sixpoint::mocks
