// A unit with mass storage and nothing else, as a USB device: one interface with a read-only volume
// (docs/devices/file-monitor.md). A host mounts it, and device/drive/ reads the folder.
//
//   SIXPOINT_ASSIGN(FatImage volume, unit_volume(unit));  // usb_unit.h
//   UsbDrive drive(unit.truth(), std::make_shared<const FatImage>(std::move(volume)), clock);
#pragma once

#include <memory>

#include "mocks/usb/mass_storage.h"
#include "mocks/usb/usb_device.h"
#include "sim/unit_truth.h"

namespace sixpoint::mocks {

class UsbDrive final : public StorageUsbDevice {
 public:
  // Interface 0; the endpoints are those of a monitor's storage (device/usb/usb_ids.h).
  static constexpr std::uint8_t kInterface = 0;

  // `volume` is never null: unit_volume() (usb_unit.h) makes one of a unit's recordings.
  UsbDrive(const sim::UnitTruth& truth, std::shared_ptr<const BlockMedium> volume,
           std::shared_ptr<Clock> clock);

 private:
  UsbAnswer own_request(const SetupPacket& setup, std::span<const std::uint8_t> data) override;
  UsbAnswer take(const UsbEndpoint& endpoint, std::span<const std::uint8_t> bytes) override;
  UsbAnswer give(const UsbEndpoint& endpoint, std::size_t max_length) override;
  void on_reset() override { storage_.reset(); }
};

}  // namespace sixpoint::mocks
