// USB/IP over TCP: virtual devices for a desktop, a container or a virtual machine on this machine.
//
//   SIXPOINT_ASSIGN(const auto server, UsbipServer::listen({unit}));
//   std::thread thread([&] { (void)server->run(); });
//   std::cout << "port " << server->port() << '\n';
//   server->stop();
//   thread.join();
//
// USB/IP has no authentication, so the server listens on 127.0.0.1 only. A device is used
// by one client at a time; when the client goes, the device is free again.
#pragma once

#include <memory>
#include <vector>

#include "mocks/usb/usbip_session.h"

namespace sixpoint::mocks {

struct UsbipServerOptions {
  std::uint16_t port = 3240;  // the one assigned to USB/IP; 0 = any that is free
  // One per device, and some that only read the list.
  std::size_t connections = 128;
  UsbipLimits limits;
};

class UsbipServer {
 public:
  // io when the port is taken.
  static Result<std::unique_ptr<UsbipServer>> listen(
      std::vector<std::shared_ptr<UsbDevice>> devices, const UsbipServerOptions& options = {});
  ~UsbipServer();
  UsbipServer(const UsbipServer&) = delete;
  UsbipServer& operator=(const UsbipServer&) = delete;

  std::uint16_t port() const;
  // Serves until stop(). All devices are used from this thread.
  Status run();
  void stop();  // from any thread

 private:
  class Sockets;
  explicit UsbipServer(std::unique_ptr<Sockets> sockets);
  std::unique_ptr<Sockets> sockets_;
};

}  // namespace sixpoint::mocks
