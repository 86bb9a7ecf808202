#include "system/vhci_bench.h"

#include <filesystem>
#include <fstream>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace sixpoint::tests {

namespace {

constexpr const char* kController = "/sys/devices/platform/vhci_hcd.0/";
constexpr int kPorts = 8;  // of the high-speed hub: ports 0 to 7 here, sockets 1-1 to 1-8 in sysfs

// Imports 1-1 as the usbip tool does; the socket, for the kernel to go on with.
int import(std::uint16_t port) {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::array<std::uint8_t, 40> request = {0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0, '1', '-', '1'};
  std::array<std::uint8_t, 320> reply{};
  if (::connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
      ::send(socket, request.data(), request.size(), 0) != static_cast<ssize_t>(request.size()) ||
      ::recv(socket, reply.data(), reply.size(), MSG_WAITALL) !=
          static_cast<ssize_t>(reply.size())) {
    ::close(socket);
    return -1;
  }
  return socket;
}

}  // namespace

struct VhciBench::Plug {
  explicit Plug(std::shared_ptr<mocks::UsbUnit> unit) : device(std::move(unit)) {}
  ~Plug() {
    if (server != nullptr) {
      server->stop();
    }
    if (thread.joinable()) {
      thread.join();
    }
  }
  std::shared_ptr<mocks::UsbUnit> device;
  std::unique_ptr<mocks::UsbipServer> server;
  std::thread thread;
};

bool wait_for_path(const std::string& path, bool there) {
  for (int i = 0; i < 1000; ++i) {
    if (std::filesystem::exists(path) == there) {
      return true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

VhciBench::VhciBench() = default;

VhciBench::~VhciBench() {
  for (auto& [port, plug] : plugs_) {
    plug->device->unplug();
    wait_for_path("/sys/bus/usb/devices/" + port, false);
  }
}

Status VhciBench::plug_in(BenchUnit& unit, const std::string& port) {
  int number = 0;
  if (port.empty()) {
    while (plugs_.contains(fmt::format("1-{}", number + 1))) {
      ++number;
    }
  } else {
    number = port.back() - '1';
  }
  if (number < 0 || number >= kPorts) {
    return fail(ErrorCode::internal, "the hub has no such port", port, "use 1-1 to 1-8");
  }
  const std::string name = fmt::format("1-{}", number + 1);
  if (!unit.device->is_plugged()) {
    unit.device->plug_in();
  }
  auto plug = std::make_unique<Plug>(unit.device);
  SIXPOINT_ASSIGN(plug->server,
                  mocks::UsbipServer::listen({unit.device}, {.port = 0, .limits = {}}));
  plug->thread = std::thread([server = plug->server.get()] { (void)server->run(); });
  // A unit that its fault plan took off the bus comes back in its time; a port is free again a
  // moment after its device is gone.
  int socket = -1;
  bool attached = false;
  for (int i = 0; i < 1000 && !attached; ++i) {
    if (socket < 0) {
      socket = import(plug->server->port());
    }
    std::ofstream attach(std::string(kController) + "attach");
    constexpr int kDeviceId = 0x10002;
    constexpr int kHighSpeed = 3;
    attach << fmt::format("{} {} {} {}", number, socket, kDeviceId, kHighSpeed) << std::flush;
    attached = attach.good();
    if (!attached) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
  ::close(socket);  // the kernel has its own reference
  if (!attached) {
    return fail(ErrorCode::internal, "the kernel did not take the device", name,
                "is vhci-hcd loaded, and is this root?");
  }
  unit.port = name;
  plugs_[name] = std::move(plug);
  return {};
}

void VhciBench::unplug(BenchUnit& unit) {
  unit.device->unplug();
  wait_for_path("/sys/bus/usb/devices/" + unit.port, false);
  plugs_.erase(unit.port);
  unit.port.clear();
}

bool VhciBench::wait_until_left(BenchUnit& unit) {
  const bool left = wait_for_path("/sys/bus/usb/devices/" + unit.port, false);
  if (left) {
    plugs_.erase(unit.port);
    unit.port.clear();
  }
  return left;
}

}  // namespace sixpoint::tests
