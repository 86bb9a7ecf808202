// The motorised jig on the bus, opened by its address.
#include "device/jigs/hid_jig.h"

#include <memory>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "device/made_units.h"
#include "expect_result.h"
#include "mocks/usb/usb_jig.h"
#include "usb/misbehaving.h"

namespace sixpoint::tests {
namespace {

using device::Pose;

class UsbHidJig : public Misbehaving {
 protected:
  void SetUp() override {
    Misbehaving::SetUp();
    device::register_hid_jig(jigs);
    turned = *virtual_units().open("virtual:seed=7", memory.env);
  }
  Result<std::unique_ptr<device::Jig>> open_jig(const std::string& address) {
    return jigs.open(address, posix_env(), *turned);
  }
  device::JigRegistry jigs;
  MemoryEnv memory;
  std::unique_ptr<device::Unit> turned;
};

TEST_F(UsbHidJig, IsOpenedByItsSerialNumberAndTurns) {
  const auto clock = std::make_shared<LeapingClock>();
  auto jig_nodes =
      bus->plug_in(std::make_shared<mocks::UsbJig>(mocks::VirtualHidJigOptions{}, nullptr, clock));
  ASSERT_OK(jig_nodes);
  EXPECT_FAILS(open_jig("hid:J999999"), ErrorCode::device_unavailable);
  for (const char* address : {"hid:J600001", "hid:"}) {
    auto jig = open_jig(address);
    ASSERT_OK(jig);
    EXPECT_EQ((*jig)->name(), "SixJig J600001");
    ASSERT_OK((*jig)->go_to(Pose::minus_y));
    EXPECT_FALSE((*jig)->position()->pose) << "it turns";
    clock->forward(std::chrono::seconds(3));
    EXPECT_EQ((*jig)->position()->pose, Pose::minus_y);
  }
  auto jig = open_jig("hid:");
  ASSERT_OK(jig);
  bus->unplug(jig_nodes->port);
  EXPECT_FAILS((*jig)->position(), ErrorCode::device_unavailable);
  EXPECT_FAILS((*jig)->stop(), ErrorCode::device_unavailable);
}

// A device with the jig's ids that does not speak as a jig.
TEST_F(UsbHidJig, WhatDoesNotAnswerAsAJigIsRefused) {
  wilful->own_descriptors = mocks::UsbJig({}, nullptr, unit.clock).descriptors();
  wilful->on_out = [](std::uint8_t) { return std::optional(mocks::UsbAnswer::done({})); };
  wilful->on_in = [](std::uint8_t) { return std::optional(mocks::UsbAnswer::nothing_yet()); };
  ASSERT_OK(bus->plug_in(wilful));
  const auto jig = open_jig("hid:J600001");
  EXPECT_FAILS(jig, ErrorCode::device_unavailable);
  EXPECT_EQ(jig.error().what, "the jig does not answer");
  EXPECT_EQ(jig.error().where, "hid:J600001");
}

}  // namespace
}  // namespace sixpoint::tests
