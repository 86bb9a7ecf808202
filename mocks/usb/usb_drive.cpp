#include "mocks/usb/usb_drive.h"

#include "device/usb/usb_ids.h"

namespace sixpoint::mocks {

namespace {

constexpr const char* kProductName = "File monitor";

UsbDescriptors drive_descriptors(const std::string& serial) {
  DescriptorBuilder usb(device::kFileMonitorProductId, kProductName, serial);
  usb.add_storage_interface();
  return usb.take();
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
