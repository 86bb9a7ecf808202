// The mass-storage interface of a device: bulk-only transport over a block medium that cannot be
// written (USB Mass Storage Class Bulk-Only Transport 1.0; SCSI SPC-2, SBC-2).
//
//   ScsiIdentity identity;
//   identity.serial = "MOS2A45130007";
//   MassStorage storage(identity);
//   storage.insert(volume);       // fat_image.h
//   storage.take(command_block);  // 31 bytes
//   const UsbAnswer data = storage.give(512);
//
// A part of a USB device, which passes on the transfers of its two bulk endpoints and halts an
// endpoint that answers stall. One thread at a time.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "mocks/usb/fat_image.h"
#include "mocks/usb/usb_device.h"

namespace sixpoint::mocks {

// The answer to INQUIRY; cut or padded to the widths.
struct ScsiIdentity {
  std::string vendor = "Sixpoint";  // 8 characters
  std::string product;              // 16
  std::string revision = "1.0";     // 4
  std::string serial;               // page 0x80
};

// Why a command failed (SPC-2, 7.23.1).
struct ScsiSense {
  std::uint8_t key = 0;
  std::uint8_t code = 0;
  std::uint8_t qualifier = 0;
};

class MassStorage {
 public:
  explicit MassStorage(ScsiIdentity identity) : identity_(std::move(identity)) {}

  // Another medium, never null: the next command reports it (unit attention 28h), unless
  // it is the first.
  void insert(std::shared_ptr<const BlockMedium> medium);

  UsbAnswer take(std::span<const std::uint8_t> bytes);  // bulk OUT
  UsbAnswer give(std::size_t max_length);               // bulk IN
  // GET_MAX_LUN and the bulk-only reset; stall for everything else.
  UsbAnswer request(const SetupPacket& setup, std::uint8_t interface);
  // After an invalid command block both endpoints stay halted until the bulk-only reset.
  bool needs_reset() const { return phase_ == Phase::broken; }
  // Waits for a command block: the moment to insert() another medium.
  bool is_idle() const { return phase_ == Phase::command; }
  void reset();

 private:
  enum class Phase { command, data_in, stalled_in, data_out, status, broken };
  struct Plan;  // what a command wants to move

  Plan execute(std::span<const std::uint8_t> command);
  Plan execute_on_medium(std::span<const std::uint8_t> command);
  static Plan capacity(Bytes begin, std::uint32_t blocks, std::uint32_t block_bytes,
                       std::size_t size, std::size_t allocation);
  Plan refuse(ScsiSense sense);
  Plan read(std::uint64_t block, std::uint64_t count);
  Plan inquiry(std::span<const std::uint8_t> command);
  Bytes status_block() const;

  ScsiIdentity identity_;
  std::shared_ptr<const BlockMedium> medium_;
  bool ejected_ = false;
  bool attention_ = false;
  ScsiSense sense_;

  Phase phase_ = Phase::command;
  std::uint32_t tag_ = 0;
  std::uint8_t status_ = 0;
  std::uint64_t expected_ = 0;  // bytes that the host announced
  std::uint64_t moved_ = 0;     // bytes that did
  std::uint64_t to_move_ = 0;   // in this command's data stage
  bool ends_short_ = false;     // less than the host expects
  std::function<Bytes(std::uint64_t offset, std::size_t length)> source_;
};

// A device with mass storage behind the endpoints kStorageInEndpoint and kStorageOutEndpoint
// (device/usb/usb_ids.h): an invalid command block halts both until the reset recovery.
class StorageUsbDevice : public StandardUsbDevice {
 protected:
  StorageUsbDevice(UsbDescriptors descriptors, std::shared_ptr<Clock> clock, ScsiIdentity identity)
      : StandardUsbDevice(std::move(descriptors), std::move(clock)),
        storage_(std::move(identity)) {}

  UsbAnswer take_storage(std::span<const std::uint8_t> bytes);
  UsbAnswer give_storage(std::size_t max_length);
  bool may_clear_halt(std::uint8_t endpoint) override;

  MassStorage storage_;

 private:
  UsbAnswer halting(UsbAnswer answer, std::uint8_t endpoint);
};

}  // namespace sixpoint::mocks
