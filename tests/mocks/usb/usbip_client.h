// A USB/IP client for tests, written from the protocol's description and sharing nothing with the
// server: it packs and unpacks its own bytes. Every wait ends after ten seconds.
#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

namespace sixpoint::tests {

class UsbipClient {
 public:
  using Data = std::vector<std::uint8_t>;

  explicit UsbipClient(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const timeval limit{10, 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("no connection to the USB/IP server");
    }
  }
  UsbipClient(const UsbipClient&) = delete;
  UsbipClient& operator=(const UsbipClient&) = delete;
  ~UsbipClient() { ::close(socket_); }

  static void put(Data& out, std::uint64_t value, unsigned width) {
    while (width-- > 0) {
      out.push_back(static_cast<std::uint8_t>(value >> (8 * width)));
    }
  }
  static std::uint64_t get(const Data& in, std::size_t at, unsigned width) {
    std::uint64_t value = 0;
    for (unsigned i = 0; i < width; ++i) {
      value = value << 8U | in.at(at + i);
    }
    return value;
  }

  void send(const Data& bytes) const {
    for (std::size_t done = 0; done < bytes.size();) {
      const auto count = ::send(socket_, bytes.data() + done, bytes.size() - done, MSG_NOSIGNAL);
      if (count <= 0) {
        return;  // the server closed: the next receive() says so
      }
      done += static_cast<std::size_t>(count);
    }
  }
  // Fewer bytes only when the server closed the connection.
  Data receive(std::size_t length) const {
    Data bytes(length);
    std::size_t done = 0;
    while (done < length) {
      const auto count = ::recv(socket_, bytes.data() + done, length - done, 0);
      if (count == 0 || (count < 0 && errno == ECONNRESET)) {
        break;
      }
      if (count < 0) {
        throw std::runtime_error("the USB/IP server says nothing");
      }
      done += static_cast<std::size_t>(count);
    }
    bytes.resize(done);
    return bytes;
  }
  bool is_closed() const { return receive(1).empty(); }

  struct Listed {
    std::string path;
    std::string busid;
    std::uint32_t bus = 0, device = 0, speed = 0;
    std::uint16_t vendor = 0, product = 0;
    std::uint8_t configuration = 0, configurations = 0, interfaces = 0;
    std::vector<std::uint32_t> classes;  // class, subclass, protocol as 0xCCSSPP
  };
  std::vector<Listed> list() const {
    Data request;
    put(request, 0x01118005, 4);
    put(request, 0, 4);
    send(request);
    const Data head = receive(12);
    if (head.size() != 12 || get(head, 0, 4) != 0x01110005 || get(head, 4, 4) != 0) {
      throw std::runtime_error("no device list");
    }
    std::vector<Listed> devices;
    for (std::uint64_t i = 0; i < get(head, 8, 4); ++i) {
      devices.push_back(parse_device(receive(312)));
      for (int j = 0; j < devices.back().interfaces; ++j) {
        devices.back().classes.push_back(static_cast<std::uint32_t>(get(receive(4), 0, 4) >> 8U));
      }
    }
    return devices;
  }

  // The reply's status; 0 is success, after which requests may be submitted.
  std::uint32_t import(const std::string& busid) {
    Data request;
    put(request, 0x01118003, 4);
    put(request, 0, 4);
    request.insert(request.end(), busid.begin(), busid.end());
    request.resize(40, 0);
    send(request);
    const Data head = receive(8);
    if (head.size() != 8 || get(head, 0, 4) != 0x01110003) {
      throw std::runtime_error("no reply to an import");
    }
    const auto status = static_cast<std::uint32_t>(get(head, 4, 4));
    if (status == 0) {
      const Listed device = parse_device(receive(312));
      device_id_ = device.bus << 16U | device.device;
    }
    return status;
  }

  struct Reply {
    std::uint32_t command = 0;
    std::uint32_t sequence = 0;
    std::int32_t status = 0;
    std::uint32_t length = 0;
    Data data;
  };
  // An OUT request carries `data`; an IN request has room for `length`.
  std::uint32_t submit(int endpoint, bool in, std::uint32_t length, const Data& data = {},
                       const Data& setup = Data(8, 0), std::uint32_t flags = 0) {
    Data request;
    put(request, 1, 4);
    put(request, ++sequence_, 4);
    put(request, device_id_, 4);
    put(request, in ? 1 : 0, 4);
    put(request, static_cast<std::uint32_t>(endpoint), 4);
    put(request, flags, 4);
    put(request, in ? length : data.size(), 4);
    put(request, 0, 4);
    put(request, 0, 4);
    put(request, 0, 4);
    request.insert(request.end(), setup.begin(), setup.end());
    request.insert(request.end(), data.begin(), data.end());
    send(request);
    if (in) {
      in_.push_back(sequence_);
    }
    return sequence_;
  }
  std::uint32_t unlink(std::uint32_t victim) {
    Data request;
    put(request, 2, 4);
    put(request, ++sequence_, 4);
    put(request, device_id_, 4);
    put(request, 0, 8);
    put(request, victim, 4);
    request.resize(48, 0);
    send(request);
    return sequence_;
  }
  // The next reply, in whatever order; none when the server closed the connection.
  std::optional<Reply> reply() const {
    const Data head = receive(48);
    if (head.size() < 48) {
      return std::nullopt;
    }
    Reply reply;
    reply.command = static_cast<std::uint32_t>(get(head, 0, 4));
    reply.sequence = static_cast<std::uint32_t>(get(head, 4, 4));
    reply.status = static_cast<std::int32_t>(static_cast<std::uint32_t>(get(head, 20, 4)));
    if (reply.command == 3) {
      reply.length = static_cast<std::uint32_t>(get(head, 24, 4));
      for (const std::uint32_t in : in_) {
        if (in == reply.sequence) {
          reply.data = receive(reply.length);
        }
      }
    }
    return reply;
  }
  // Submits and waits for this one answer; nothing else may be under way.
  Reply in(int endpoint, std::uint32_t length) {
    submit(endpoint, true, length);
    return reply().value();
  }
  Reply out(int endpoint, const Data& data) {
    submit(endpoint, false, 0, data);
    return reply().value();
  }
  Reply control(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                std::uint16_t length, const Data& data = {}) {
    const auto low = [](std::uint16_t word) { return static_cast<std::uint8_t>(word & 0xFFU); };
    const auto high = [](std::uint16_t word) { return static_cast<std::uint8_t>(word >> 8U); };
    submit(0, (type & 0x80U) != 0, length, data,
           {type, request, low(value), high(value), low(index), high(index), low(length),
            high(length)});
    return reply().value();
  }

 private:
  static Listed parse_device(const Data& bytes) {
    Listed device;
    device.path = reinterpret_cast<const char*>(bytes.data());
    device.busid = reinterpret_cast<const char*>(bytes.data() + 256);
    device.bus = static_cast<std::uint32_t>(get(bytes, 288, 4));
    device.device = static_cast<std::uint32_t>(get(bytes, 292, 4));
    device.speed = static_cast<std::uint32_t>(get(bytes, 296, 4));
    device.vendor = static_cast<std::uint16_t>(get(bytes, 300, 2));
    device.product = static_cast<std::uint16_t>(get(bytes, 302, 2));
    device.configuration = bytes.at(309);
    device.configurations = bytes.at(310);
    device.interfaces = bytes.at(311);
    return device;
  }

  int socket_;
  std::uint32_t device_id_ = 0;
  std::uint32_t sequence_ = 0;
  std::vector<std::uint32_t> in_;
};

}  // namespace sixpoint::tests
