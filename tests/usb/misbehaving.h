// A unit on umockdev's bus that answers as a test wants, and the link that the program has to it.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>

#include <gtest/gtest.h>

#include "device/usb/discovery.h"
#include "expect_result.h"
#include "mocks/umockdev/umockdev_bus.h"
#include "usb/bench.h"

namespace sixpoint::tests {

// A unit whose answers on endpoints a test may replace.
class Wilful final : public mocks::UsbDevice {
 public:
  explicit Wilful(std::shared_ptr<mocks::UsbDevice> inner) : inner_(std::move(inner)) {}

  const mocks::UsbDescriptors& descriptors() const override {
    return own_descriptors ? *own_descriptors : inner_->descriptors();
  }
  Clock& clock() override { return inner_->clock(); }
  mocks::UsbAnswer control(const mocks::SetupPacket& setup,
                           std::span<const std::uint8_t> data) override {
    if (setup.request_type == 0x02 && setup.request == 1) {
      ++cleared_halts;
    }
    return inner_->control(setup, data);
  }
  mocks::UsbAnswer out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override {
    const auto own = on_out ? on_out(endpoint) : std::nullopt;
    return own ? *own : inner_->out(endpoint, bytes);
  }
  mocks::UsbAnswer in(std::uint8_t endpoint, std::size_t max_length) override {
    const auto own = on_in ? on_in(endpoint) : std::nullopt;
    return own ? *own : inner_->in(endpoint, max_length);
  }
  std::optional<std::chrono::nanoseconds> next_due() const override { return inner_->next_due(); }
  void bus_reset() override { inner_->bus_reset(); }
  void unplug() override { inner_->unplug(); }
  void plug_in() override { inner_->plug_in(); }
  bool is_plugged() const override { return inner_->is_plugged(); }

  // Called by the carrier's threads; set before the device is plugged in.
  std::function<std::optional<mocks::UsbAnswer>(std::uint8_t)> on_out;
  std::function<std::optional<mocks::UsbAnswer>(std::uint8_t)> on_in;
  std::optional<mocks::UsbDescriptors> own_descriptors;  // instead of the unit's
  std::atomic<int> cleared_halts = 0;

 private:
  std::shared_ptr<mocks::UsbDevice> inner_;
};

class Misbehaving : public testing::Test {
 protected:
  void SetUp() override {
    auto made = mocks::UmockdevBus::make();
    ASSERT_OK(made);
    bus = std::move(*made);
    unit = make_unit(7);
    wilful = std::make_shared<Wilful>(unit.device);
  }
  // Plugs it in as it is set now.
  Result<device::Link> open() {
    SIXPOINT_ASSIGN(nodes, bus->plug_in(wilful));
    device::TransportRegistry registry;
    device::register_usb(registry);
    return registry.open(unit.hid_address(), posix_env());
  }

  std::unique_ptr<mocks::UmockdevBus> bus;
  BenchUnit unit;
  std::shared_ptr<Wilful> wilful;
  mocks::PluggedNodes nodes;
};

}  // namespace sixpoint::tests
