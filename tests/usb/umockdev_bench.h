// The carrier that needs no kernel: umockdev (mocks/umockdev_bus.h).
#pragma once

#include <memory>

#include "mocks/umockdev_bus.h"
#include "usb/bench.h"

namespace sixpoint::tests {

class UmockdevBench final : public UsbBench {
 public:
  explicit UmockdevBench(std::unique_ptr<mocks::UmockdevBus> bus) : bus_(std::move(bus)) {}

  Status plug_in(BenchUnit& unit, const std::string& port = {}) override {
    SIXPOINT_ASSIGN(const auto nodes, bus_->plug_in(unit.device, port));
    unit.port = nodes.port;
    return {};
  }
  void unplug(BenchUnit& unit) override {
    bus_->unplug(unit.port);
    unit.port.clear();
  }
  mocks::UmockdevBus& bus() { return *bus_; }

 private:
  std::unique_ptr<mocks::UmockdevBus> bus_;
};

}  // namespace sixpoint::tests
