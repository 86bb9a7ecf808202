// Devices that come and go, over umockdev; what holds on a real kernel too is in bodies.cpp.
#include "device/usb/hotplug.h"

#include <chrono>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "usb/umockdev_bench.h"

namespace sixpoint::tests {
namespace {

using device::HotplugEvent;
using device::HotplugWatch;
using std::chrono::milliseconds;
using std::chrono::seconds;

class Hotplug : public testing::Test {
 protected:
  void SetUp() override {
    auto bus = mocks::UmockdevBus::make();
    ASSERT_OK(bus);
    bench = std::make_unique<UmockdevBench>(std::move(*bus));
  }
  // "arrived SERIAL", "left SERIAL"; "nothing" after the time-out.
  static std::string next(HotplugWatch& watch, std::chrono::nanoseconds time_out = seconds(10)) {
    const auto event = watch.next(time_out);
    if (!event) {
      return event.error().brief();
    }
    if (!*event) {
      return "nothing";
    }
    return ((*event)->kind == HotplugEvent::Kind::arrived ? "arrived " : "left ") +
           (*event)->device.serial;
  }

  std::unique_ptr<UmockdevBench> bench;
};

// Oracle: hotplug.h: what is plugged in at the start is reported as arrived, in the order of ports.
TEST_F(Hotplug, WhatIsThereAtTheStartArrivesInTheOrderOfItsPorts) {
  auto third = make_unit(3);
  auto first = make_unit(1);
  ASSERT_OK(bench->plug_in(third, "1-3"));
  ASSERT_OK(bench->plug_in(first, "1-1"));
  const auto watch = HotplugWatch::start();
  ASSERT_OK(watch);
  EXPECT_EQ(next(**watch), "arrived " + first.serial);
  EXPECT_EQ(next(**watch), "arrived " + third.serial);
  EXPECT_EQ(next(**watch, milliseconds(50)), "nothing");
}

// Oracle: the order in which it was done, between two calls of next(). Another device in the same
// port is one departure and one arrival.
TEST_F(Hotplug, NothingIsLostWhileNobodyAsks) {
  for (const auto& [before, after] : {std::pair("1-1", "1-3"), std::pair("1-2", "1-2")}) {
    auto a = make_unit(1);
    auto b = make_unit(2);
    ASSERT_OK(bench->plug_in(a, before));
    const auto watch = HotplugWatch::start();
    ASSERT_OK(watch);
    EXPECT_EQ(next(**watch), "arrived " + a.serial);
    bench->unplug(a);
    ASSERT_OK(bench->plug_in(b, after));
    EXPECT_EQ(next(**watch), "left " + a.serial);
    EXPECT_EQ(next(**watch), "arrived " + b.serial);
    bench->unplug(b);
  }
}

TEST_F(Hotplug, AFilterSeesItsProductsAndSerialsAlone) {
  device::DiscoveryFilter jigs;
  jigs.product_ids = {device::kJigProductId};
  auto a = make_unit(1);
  auto b = make_unit(2);
  device::DiscoveryFilter only_b;
  only_b.serial = b.serial;
  const auto watch_jigs = HotplugWatch::start(jigs);
  const auto watch_b = HotplugWatch::start(only_b);
  ASSERT_OK(watch_jigs);
  ASSERT_OK(watch_b);
  ASSERT_OK(bench->plug_in(a));
  ASSERT_OK(bench->plug_in(b));
  EXPECT_EQ(next(**watch_b), "arrived " + b.serial);
  EXPECT_EQ(next(**watch_b, milliseconds(50)), "nothing");
  EXPECT_EQ(next(**watch_jigs, milliseconds(50)), "nothing");
}

// Oracle: hotplug.h: a cancelled watch waits no more, and reports nothing that comes later.
TEST_F(Hotplug, AfterCancelThereIsNothing) {
  auto a = make_unit(1);
  auto b = make_unit(2);
  ASSERT_OK(bench->plug_in(a));
  const auto watch = HotplugWatch::start();
  ASSERT_OK(watch);
  EXPECT_EQ(next(**watch), "arrived " + a.serial);
  (*watch)->cancel();
  EXPECT_EQ(next(**watch, std::chrono::hours(1)), "nothing");
  ASSERT_OK(bench->plug_in(b));
  EXPECT_EQ(next(**watch, std::chrono::hours(1)), "nothing");
}

}  // namespace
}  // namespace sixpoint::tests
