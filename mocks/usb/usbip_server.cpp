#include "mocks/usb/usbip_server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <list>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

namespace sixpoint::mocks {

namespace {

class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() {
    if (number_ >= 0) {
      ::close(number_);
    }
  }
  int get() const { return number_; }

 private:
  int number_;
};

tl::unexpected<Error> system_failure(ErrorCode code, const char* doing, std::uint16_t port,
                                     const char* hint) {
  return fail(code, fmt::format("{}: {}", doing, std::strerror(errno)),
              fmt::format("127.0.0.1:{}", port), hint);
}

}  // namespace

class UsbipServer::Sockets {
 public:
  Sockets(std::vector<std::shared_ptr<UsbDevice>> devices, const UsbipServerOptions& options)
      : options_(options), bus_(std::move(devices)) {}

  Status open() {
    stop_ = Descriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    listener_ = Descriptor(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (stop_.get() < 0 || listener_.get() < 0) {
      return system_failure(ErrorCode::io, "no socket can be made", options_.port,
                            "close other programs");
    }
    const int yes = 1;
    ::setsockopt(listener_.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(options_.port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    if (::bind(listener_.get(), generic, length) != 0 || ::listen(listener_.get(), 16) != 0 ||
        ::getsockname(listener_.get(), generic, &length) != 0) {
      return system_failure(ErrorCode::device_unavailable, "the port cannot be listened on",
                            options_.port, "choose another port, or 0 for any that is free");
    }
    port_ = ntohs(address.sin_port);
    return {};
  }

  std::uint16_t port() const { return port_; }

  void stop() {
    const std::uint64_t one = 1;
    // A full eventfd is as good: stop() was called before.
    [[maybe_unused]] const auto written = ::write(stop_.get(), &one, sizeof one);
  }

  Status run() {
    for (;;) {
      std::vector<pollfd> watched = {{stop_.get(), POLLIN, 0}, {listener_.get(), 0, 0}};
      if (connections_.size() < options_.connections) {
        watched[1].events = POLLIN;
      }
      // Another thread may change a device (unplug it, turn it): check after this time.
      std::chrono::nanoseconds wait = std::chrono::seconds(10);
      for (const Connection& connection : connections_) {
        int events = connection.session.wants_input() ? POLLIN : 0;
        events |= connection.session.output().empty() ? 0 : POLLOUT;
        watched.push_back({connection.socket.get(), static_cast<short>(events), 0});
        if (connection.session.device() != nullptr) {
          wait = std::min(wait, kLongestWait);
        }
        wait = std::min(wait, connection.session.wait().value_or(wait));
      }
      timespec time_out{};
      time_out.tv_sec = wait.count() / 1'000'000'000;
      time_out.tv_nsec = wait.count() % 1'000'000'000;
      if (::ppoll(watched.data(), watched.size(), &time_out, nullptr) < 0 && errno != EINTR) {
        return system_failure(ErrorCode::io, "waiting for clients failed", port_,
                              "start the command again");
      }
      if (watched[0].revents != 0) {
        connections_.clear();
        return {};
      }
      std::size_t at = 2;
      for (auto connection = connections_.begin(); connection != connections_.end(); ++at) {
        const bool stays = serve(*connection, watched[at].revents);
        connection = stays ? std::next(connection) : connections_.erase(connection);
      }
      if ((watched[1].revents & POLLIN) != 0) {
        accept();
      }
    }
  }

 private:
  static constexpr std::chrono::nanoseconds kLongestWait = std::chrono::milliseconds(20);

  struct Connection {
    Connection(Descriptor&& accepted, UsbipBus& bus, const UsbipLimits& limits)
        : socket(std::move(accepted)), session(bus, limits) {}
    Descriptor socket;
    UsbipSession session;
  };

  void accept() {
    Descriptor socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (socket.get() < 0) {
      return;
    }
    const int yes = 1;
    ::setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    connections_.emplace_back(std::move(socket), bus_, options_.limits);
  }

  // False when the connection is at its end.
  bool serve(Connection& connection, int events) {
    UsbipSession& session = connection.session;
    if ((events & (POLLIN | POLLHUP | POLLERR)) != 0 && session.wants_input()) {
      const auto count = ::recv(connection.socket.get(), buffer_.data(), buffer_.size(), 0);
      if (count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR)) {
        return false;
      }
      if (count > 0) {
        session.receive(std::span(buffer_).first(static_cast<std::size_t>(count)));
      }
    }
    session.pump();
    while (!session.output().empty()) {
      const auto count = ::send(connection.socket.get(), session.output().data(),
                                session.output().size(), MSG_NOSIGNAL);
      if (count < 0) {
        if (errno == EINTR) {
          continue;
        }
        return errno == EAGAIN;
      }
      session.sent(static_cast<std::size_t>(count));
    }
    if (session.is_over()) {
      // A client that sent a little more than was read sees the end of the stream, not a reset.
      ::shutdown(connection.socket.get(), SHUT_WR);
      [[maybe_unused]] const auto rest =
          ::recv(connection.socket.get(), buffer_.data(), buffer_.size(), 0);
      return false;
    }
    return true;
  }

  UsbipServerOptions options_;
  UsbipBus bus_;
  Descriptor listener_;
  Descriptor stop_;
  std::uint16_t port_ = 0;
  std::list<Connection> connections_;
  std::array<std::uint8_t, 65536> buffer_{};
};

UsbipServer::UsbipServer(std::unique_ptr<Sockets> sockets) : sockets_(std::move(sockets)) {}
UsbipServer::~UsbipServer() = default;

Result<std::unique_ptr<UsbipServer>> UsbipServer::listen(
    std::vector<std::shared_ptr<UsbDevice>> devices, const UsbipServerOptions& options) {
  auto sockets = std::make_unique<Sockets>(std::move(devices), options);
  SIXPOINT_CHECK(sockets->open());
  return std::unique_ptr<UsbipServer>(new UsbipServer(std::move(sockets)));
}

std::uint16_t UsbipServer::port() const { return sockets_->port(); }
Status UsbipServer::run() { return sockets_->run(); }
void UsbipServer::stop() { sockets_->stop(); }

}  // namespace sixpoint::mocks
