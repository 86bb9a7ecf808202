// The virtual unit as a composite USB device: interface 0 HID (reports), interface 1 vendor bulk
// (downloads), interface 2 mass storage (info.txt and log.bin), in one configuration.
//
//   auto plugged = std::make_shared<PluggedUnit>(VirtualUnitOptions{}, clock);
//   auto unit = std::make_shared<UsbUnit>(plugged);
//   SIXPOINT_ASSIGN(const auto server, UsbipServer::listen({unit}));  // usbip_server.h
//
// The volume shows the newest recording as info.txt and log.bin, and older ones the same way in
// REC00001, REC00002 ... A unit that has recorded nothing shows an empty recording of itself.
//
// The unit's fault plan (PluggedUnit::faults) acts on what the endpoints of interfaces 0 and 1
// carry. A unit that left the bus by its plan answers `gone` until the host has reset its port: by
// then it may be another one, with other descriptors (swap).
#pragma once

#include <memory>

#include "mocks/in_process/in_process.h"
#include "mocks/usb/mass_storage.h"
#include "mocks/usb/usb_device.h"

namespace sixpoint::mocks {

// The volume that a file manager shows; configuration when the recordings do not fit.
Result<FatImage> unit_volume(const VirtualUnit& unit);

class UsbUnit final : public StorageUsbDevice {
 public:
  // The unit is shared with its jig (virtual_jig.h) and with tests; its mutex is held while the
  // device answers.
  explicit UsbUnit(std::shared_ptr<PluggedUnit> plugged);

  std::optional<std::chrono::nanoseconds> next_due() const override;
  PluggedUnit& plugged() { return *plugged_; }

 private:
  UsbAnswer own_request(const SetupPacket& setup, std::span<const std::uint8_t> data) override;
  UsbAnswer take(const UsbEndpoint& endpoint, std::span<const std::uint8_t> bytes) override;
  UsbAnswer give(const UsbEndpoint& endpoint, std::size_t max_length) override;
  void on_reset() override;
  void on_plug(bool plugged) override;
  bool is_on_bus() const override;

  UsbAnswer take_reports(std::span<const std::uint8_t> bytes);
  UsbAnswer give_report(std::size_t max_length);
  void show_recordings();

  std::shared_ptr<PluggedUnit> plugged_;
  TransferQueue bulk_;
  std::uint64_t download_of_bulk_ = 0;  // to which request what is in bulk_ belongs
  std::optional<std::size_t> recordings_shown_;
  Bytes last_report_ = Bytes(device::kReportBytes, std::uint8_t{0});
  std::uint32_t enumeration_seen_ = 0;  // of the fault plan
};

}  // namespace sixpoint::mocks
