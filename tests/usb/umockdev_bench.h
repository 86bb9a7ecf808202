// The carrier that needs no kernel: umockdev (mocks/umockdev/umockdev_bus.h).
#pragma once

#include <memory>
#include <thread>

#include "mocks/umockdev/umockdev_bus.h"
#include "usb/bench.h"

namespace sixpoint::tests {

class UmockdevBench final : public UsbBench {
 public:
  explicit UmockdevBench(std::unique_ptr<mocks::UmockdevBus> bus) : bus_(std::move(bus)) {}

  Status plug_in(BenchUnit& unit, const std::string& port = {}) override {
    // A hub resets the port of a device that came back; until then its plan keeps it away.
    if (!unit.device->is_plugged()) {
      unit.device->plug_in();
    }
    for (int i = 0; i < 1000 && !unit.device->is_plugged(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      unit.device->bus_reset();
    }
    SIXPOINT_ASSIGN(const auto nodes, bus_->plug_in(unit.device, port));
    unit.port = nodes.port;
    return {};
  }
  void unplug(BenchUnit& unit) override {
    bus_->unplug(unit.port);
    unit.port.clear();
  }
  bool wait_until_left(BenchUnit& unit) override {
    for (int i = 0; i < 1000; ++i) {
      if (!unit.device->is_plugged()) {
        unplug(unit);
        return true;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }
  mocks::UmockdevBus& bus() { return *bus_; }

 private:
  std::unique_ptr<mocks::UmockdevBus> bus_;
};

}  // namespace sixpoint::tests
