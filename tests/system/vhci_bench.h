// The carrier with a real kernel: units are offered by the project's own USB/IP server on 127.0.0.1
// and attached to vhci-hcd, the kernel's virtual host controller. As root, on a machine of its own
// (run_in_qemu.sh).
#pragma once

#include <map>
#include <memory>
#include <thread>

#include "mocks/usb/usbip_server.h"
#include "usb/bench.h"

namespace sixpoint::tests {

class VhciBench final : public UsbBench {
 public:
  VhciBench();
  ~VhciBench() override;
  VhciBench(const VhciBench&) = delete;
  VhciBench& operator=(const VhciBench&) = delete;
  Status plug_in(BenchUnit& unit, const std::string& port = {}) override;
  void unplug(BenchUnit& unit) override;
  bool wait_until_left(BenchUnit& unit) override;

 private:
  struct Plug;
  std::map<std::string, std::unique_ptr<Plug>> plugs_;  // by port
};

// Waits until `path` is there (or gone); false after ten seconds.
bool wait_for_path(const std::string& path, bool there = true);

}  // namespace sixpoint::tests
