// A printer in the network, for tests: each connection is given to `behave`, on a thread.
//
//   FakePrinter printer([](int connection) { FakePrinter::read_all(connection); });
//   parse_printer(printer.address());
#pragma once

#include <array>
#include <functional>
#include <string>
#include <thread>

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace sixpoint::station {

class FakePrinter {
 public:
  explicit FakePrinter(std::function<void(int)> behave, int port = 0) {
    listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
    const int reuse = 1;
    ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof(reuse));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    if (::bind(listener_, reinterpret_cast<sockaddr*>(&address), size) == 0 &&
        ::listen(listener_, 8) == 0 &&
        ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) == 0) {
      port_ = ntohs(address.sin_port);
    }
    thread_ = std::jthread([this, behave = std::move(behave)](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        pollfd ready{listener_, POLLIN, 0};
        if (::poll(&ready, 1, 20) > 0) {
          const int connection = ::accept(listener_, nullptr, nullptr);
          behave(connection);
          ::close(connection);
        }
      }
    });
  }
  ~FakePrinter() {
    thread_ = std::jthread();
    ::close(listener_);
  }
  FakePrinter(const FakePrinter&) = delete;
  FakePrinter& operator=(const FakePrinter&) = delete;

  int port() const { return port_; }
  std::string address() const { return "tcp://127.0.0.1:" + std::to_string(port_); }

  // What the station sent until it closed its side.
  static std::string read_all(int connection) {
    std::string all;
    std::array<char, 256> some{};
    for (ssize_t n = 1; n > 0;) {
      n = ::recv(connection, some.data(), some.size(), 0);
      all.append(some.data(), static_cast<std::size_t>(n > 0 ? n : 0));
    }
    return all;
  }

 private:
  int listener_ = -1;
  int port_ = 0;
  std::jthread thread_;
};

}  // namespace sixpoint::station
