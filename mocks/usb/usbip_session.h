// USB/IP, the server's side of one connection, as bytes in and bytes out (Linux,
// Documentation/usb/usbip_protocol.rst, version 1.1.1). The sockets are usbip_server.h.
//
//   UsbipBus bus({unit});
//   UsbipSession session(bus);
//   session.receive(bytes);  // from the peer
//   const std::span<const std::uint8_t> to_send = session.output();
//   session.sent(to_send.size());  // when the peer has it
//
// The peer is not trusted: every length is checked before memory is used for it, pending requests
// and waiting answers are bounded, and a breach of the protocol ends the session.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "mocks/usb/usb_device.h"

namespace sixpoint::mocks {

// The devices that are offered: bus ids 1-1, 1-2 ... in their order.
class UsbipBus {
 public:
  struct Port {
    std::string busid;
    std::uint32_t bus_number = 1;
    std::uint32_t device_number = 0;
    std::shared_ptr<UsbDevice> device;
    bool in_use = false;
  };
  explicit UsbipBus(std::vector<std::shared_ptr<UsbDevice>> devices);

  const std::vector<Port>& ports() const { return ports_; }
  Port* find(std::string_view busid);  // null where there is none

 private:
  std::vector<Port> ports_;
};

struct UsbipLimits {
  // Linux' own USB file system takes no more at once (usbfs_memory_mb).
  std::size_t transfer_bytes = 16U << 20U;
  std::size_t requests = 4096;  // under way
  // Answers that the peer has not fetched, and data on its way out: beyond, nothing more is read or
  // asked of the device.
  std::size_t waiting_bytes = 32U << 20U;
};

// One thread at a time. `bus` must outlive it. At the end of a session pending requests are
// forgotten and the device can be imported again.
class UsbipSession {
 public:
  explicit UsbipSession(UsbipBus& bus, UsbipLimits limits = {});
  UsbipSession(const UsbipSession&) = delete;
  UsbipSession& operator=(const UsbipSession&) = delete;
  ~UsbipSession();

  // False while the peer should be made to wait.
  bool wants_input() const;
  void receive(std::span<const std::uint8_t> bytes);
  // Repeats the requests that the device had no data for: after receive(), and as time passes.
  void pump();
  // What is to be sent; sent() takes the first `count` bytes off.
  std::span<const std::uint8_t> output() const { return std::span(output_).subspan(output_taken_); }
  void sent(std::size_t count);
  // The connection is to be closed once output() is empty.
  bool is_over() const { return over_; }
  // How long the pending requests will wait at least; none when time alone changes nothing.
  std::optional<std::chrono::nanoseconds> wait() const;
  const UsbDevice* device() const { return port_ == nullptr ? nullptr : port_->device.get(); }

 private:
  struct Request {
    std::uint32_t sequence = 0;
    std::uint32_t flags = 0;
    std::uint32_t packets = 0;  // as it was sent; isochronous requests alone have any
    std::uint32_t length = 0;
    SetupPacket setup;
    Bytes data;
  };

  // Each takes one whole message off the front of `bytes`, or answers false: not all of it is here.
  bool take_operation(std::span<const std::uint8_t>& bytes);
  bool take_command(std::span<const std::uint8_t>& bytes);
  void list_devices();
  void import(std::string_view busid);
  void put_device(const UsbipBus::Port& port);
  void unlink(std::uint32_t sequence, std::uint32_t victim);
  UsbAnswer try_once(std::uint8_t address, const Request& request);
  void complete(std::uint8_t address, const Request& request, const UsbAnswer& answer);
  void put_reply(std::uint32_t command, std::uint32_t sequence, std::int32_t status,
                 std::uint32_t actual_length, std::uint32_t packets);
  void end();

  UsbipBus& bus_;
  UsbipLimits limits_;
  UsbipBus::Port* port_ = nullptr;
  Bytes input_;
  Bytes output_;
  std::size_t output_taken_ = 0;
  // By endpoint address; control requests under 0. Each is answered in its order.
  std::map<std::uint8_t, std::deque<Request>> waiting_;
  std::size_t requests_ = 0;
  std::size_t request_bytes_ = 0;
  std::chrono::nanoseconds asked_at_{0};  // when the device was last asked
  bool over_ = false;
};

}  // namespace sixpoint::mocks
