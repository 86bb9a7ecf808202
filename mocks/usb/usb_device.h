// A USB device in software, without input or output of its own: descriptors, and the answers to
// control requests and on its endpoints. A carrier (USB/IP, umockdev, a test) connects it with a
// host; a class that implements UsbDevice over another one may change what passes.
//
//   UsbUnit unit(plugged);                 // usb_unit.h
//   unit.control({0x00, 9, 1, 0, 0}, {});  // SET_CONFIGURATION
//   UsbAnswer report = unit.in(device::kHidInEndpoint, 64);
//
// The unit of exchange is the transfer, as the host's USB request block is: in() gives a whole
// transfer, ended by a short packet, by a packet of length zero, or because the host's buffer is
// full.
//
// Time is that of clock(). All functions may be called from any thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/env.h"
#include "mocks/usb/usb_descriptors.h"

namespace sixpoint::mocks {

// The eight bytes that open a control request (USB 2.0, table 9-2).
struct SetupPacket {
  std::uint8_t request_type = 0;
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  std::uint16_t length = 0;

  bool device_to_host() const { return (request_type & 0x80U) != 0; }

  bool operator==(const SetupPacket&) const = default;
};
SetupPacket parse_setup(std::span<const std::uint8_t, 8> bytes);

struct UsbAnswer {
  enum class Kind {
    done,         // OUT: taken; IN: `bytes` are the transfer, perhaps none
    nothing_yet,  // NAK: the carrier repeats the request later, see next_due()
    stall,
    overflow,  // a packet of the device is longer than what is left of the host's buffer
    gone,      // the device is not plugged in
  };
  Kind kind = Kind::done;
  Bytes bytes;

  static UsbAnswer done(Bytes bytes = {}) { return {Kind::done, std::move(bytes)}; }
  static UsbAnswer nothing_yet() { return {Kind::nothing_yet, {}}; }
  static UsbAnswer stall() { return {Kind::stall, {}}; }
  static UsbAnswer gone() { return {Kind::gone, {}}; }
};

class UsbDevice {
 public:
  virtual ~UsbDevice() = default;

  virtual const UsbDescriptors& descriptors() const = 0;
  virtual Clock& clock() = 0;

  // A whole control request. `data` is the data stage towards the device. The answer to one
  // towards the host is never longer than setup.length.
  virtual UsbAnswer control(const SetupPacket& setup, std::span<const std::uint8_t> data) = 0;
  // One transfer to an OUT endpoint: done or not at all.
  virtual UsbAnswer out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) = 0;
  // One transfer from an IN endpoint (address with 0x80) into a buffer of `max_length` bytes.
  virtual UsbAnswer in(std::uint8_t endpoint, std::size_t max_length) = 0;
  // When an endpoint that answered nothing_yet may have something by itself; none when only another
  // transfer can change that.
  virtual std::optional<std::chrono::nanoseconds> next_due() const = 0;

  // The host resets the port: unconfigured, no halt, pending transfers are forgotten.
  virtual void bus_reset() = 0;

  // The cable. Everything answers `gone` until plug_in(), after which it is as after bus_reset().
  virtual void unplug() = 0;
  virtual void plug_in() = 0;
  virtual bool is_plugged() const = 0;
};

// What every USB device must answer (USB 2.0, chapter 9; HID 1.11, section 7.1), over descriptors.
// A class that derives from it adds the rest. Protected functions are called with the mutex held.
class StandardUsbDevice : public UsbDevice {
 public:
  // The descriptors are the program's own: that they hold is a precondition.
  StandardUsbDevice(UsbDescriptors descriptors, std::shared_ptr<Clock> clock);

  const UsbDescriptors& descriptors() const final { return descriptors_; }
  Clock& clock() final { return *clock_; }
  UsbAnswer control(const SetupPacket& setup, std::span<const std::uint8_t> data) final;
  UsbAnswer out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) final;
  UsbAnswer in(std::uint8_t endpoint, std::size_t max_length) final;
  std::optional<std::chrono::nanoseconds> next_due() const override { return std::nullopt; }
  void bus_reset() final;
  void unplug() final;
  void plug_in() final;
  bool is_plugged() const final;

 protected:
  // Class and vendor requests; for a HID interface only those that touch reports come here
  // (GET_REPORT, SET_REPORT).
  virtual UsbAnswer own_request(const SetupPacket& setup, std::span<const std::uint8_t> data);
  // Transfers on endpoints that exist and are not halted, of a device that is configured.
  virtual UsbAnswer take(const UsbEndpoint& endpoint, std::span<const std::uint8_t> bytes) = 0;
  virtual UsbAnswer give(const UsbEndpoint& endpoint, std::size_t max_length) = 0;
  // Bus reset, SET_CONFIGURATION, the cable pulled or put back.
  virtual void on_reset() {}
  virtual void on_plug(bool /*plugged*/) {}
  // False while the device is off the bus for a reason of its own.
  virtual bool is_on_bus() const { return true; }
  // Only from on_reset(): what the host will find from now on.
  void describe(UsbDescriptors descriptors);
  // False keeps it halted, as mass storage does until its reset recovery.
  virtual bool may_clear_halt(std::uint8_t /*endpoint*/) { return true; }

  void halt(std::uint8_t endpoint) { halted_.insert(endpoint); }

 private:
  void reset();
  UsbAnswer standard_request(const SetupPacket& setup);
  UsbAnswer get_descriptor(const SetupPacket& setup) const;
  UsbAnswer endpoint_request(const SetupPacket& setup);
  UsbAnswer interface_request(const SetupPacket& setup) const;
  std::optional<UsbAnswer> hid_request(const SetupPacket& setup);

  UsbDescriptors descriptors_;
  UsbConfiguration configuration_;
  std::shared_ptr<Clock> clock_;
  mutable std::mutex mutex_;  // guards what follows
  bool plugged_ = true;
  std::uint8_t configuration_value_ = 0;
  std::set<std::uint8_t> halted_;
  std::map<std::uint8_t, std::uint8_t> idle_rate_;  // of HID interfaces
};

// One transfer out of a message that may be longer than the host's buffer or end on a packet
// boundary: the rest stays for the next transfer, and a message whose length is a multiple of the
// packet size is ended by an empty packet where the buffer did not end it.
class TransferQueue {
 public:
  explicit TransferQueue(std::size_t max_packet) : max_packet_(max_packet) {}
  bool empty() const { return rest_.empty() && !owes_empty_packet_; }
  void put(Bytes message);
  UsbAnswer next(std::size_t max_length);
  void clear();

 private:
  std::size_t max_packet_;
  Bytes rest_;
  std::size_t at_ = 0;
  bool owes_empty_packet_ = false;
};

}  // namespace sixpoint::mocks
