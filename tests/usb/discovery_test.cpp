// Finding devices that are not as they should be, over umockdev; what holds on a real kernel too is
// in bodies.cpp.
#include "device/usb/discovery.h"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "mocks/usb/usb_descriptors.h"
#include "usb/misbehaving.h"
#include "usb/plugged.h"

namespace sixpoint::tests {
namespace {

using device::DiscoveryFilter;
using testing::HasSubstr;

class UsbDiscovery : public Misbehaving {
 protected:
  ManualClock clock;  // finding a device waits on it
};

// The same unit in two ports: no test of the program may reach the wrong one.
TEST_F(UsbDiscovery, TwoDevicesWithOneSerialNumberAreRefused) {
  auto twin = make_unit(7);
  ASSERT_EQ(twin.serial, unit.serial);
  ASSERT_OK(bus->plug_in(wilful, "1-2"));
  ASSERT_OK(bus->plug_in(twin.device, "1-4"));
  DiscoveryFilter filter;
  filter.serial = unit.serial;
  const auto found = device::find_device(filter, clock);
  EXPECT_FAILS(found, ErrorCode::device_unavailable);
  EXPECT_EQ(found.error().what, "two devices have the serial number " + unit.serial);
  EXPECT_EQ(found.error().where, "ports 1-2 and 1-4");
  bus->unplug("1-4");
  EXPECT_EQ(device::find_device(filter, clock)->port, "1-2");
}

// A kernel without the driver for HID: the unit is listed, and opening it says what to load.
TEST_F(UsbDiscovery, AUnitWithoutAHidrawNodeIsNotOpened) {
  mocks::DescriptorBuilder usb(device::kMonitorProductId, "No reports", unit.serial);
  usb.add_storage_interface();
  wilful->own_descriptors = usb.take();
  ASSERT_OK(bus->plug_in(wilful));
  const auto listed = device::attached_devices();
  ASSERT_OK(listed);
  ASSERT_EQ(listed->size(), 1U);
  EXPECT_FALSE(listed->front().complete());
  EXPECT_EQ(listed->front().hidraw_node, "");
  const auto began = clock.elapsed();
  const auto found = device::find_device({}, clock);
  EXPECT_FAILS(found, ErrorCode::device_unavailable);
  EXPECT_THAT(found.error().what, HasSubstr("no hidraw node"));
  EXPECT_EQ(found.error().where, listed->front().usb_node);
  EXPECT_THAT(found.error().hint, HasSubstr("modprobe"));
  EXPECT_GE(clock.elapsed() - began, std::chrono::milliseconds(500)) << "the kernel may be at it";
  const Status access = device::check_access(listed->front());
  EXPECT_FAILS(access, ErrorCode::device_unavailable);
  EXPECT_EQ(access.error().where, listed->front().port);
}

// Without a serial number a unit is named by its port.
TEST_F(UsbDiscovery, AUnitWithoutASerialNumberIsNamedByItsPort) {
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(8);
  options.truth.serial = "";
  ASSERT_OK(bus->plug_in(std::make_shared<mocks::UsbUnit>(std::make_shared<mocks::PluggedUnit>(
                             std::move(options), std::make_shared<LeapingClock>())),
                         "1-3"));
  ASSERT_OK(bus->plug_in(wilful, "1-2"));
  const auto several = device::find_device({}, clock);
  EXPECT_FAILS(several, ErrorCode::usage);
  EXPECT_EQ(several.error().hint, "name one by its serial number: " + unit.serial + ", port 1-3");
}

// Other makers' devices have no model of ours, also with one of our product ids.
TEST_F(UsbDiscovery, OtherVendorsDevicesAreFoundWhereTheyAreAskedFor) {
  mocks::UsbDescriptors other = unit.device->descriptors();
  other.device[8] = 0x34;  // USB 2.0, table 9-8: idVendor
  other.device[9] = 0x12;
  wilful->own_descriptors = other;
  ASSERT_OK(bus->plug_in(wilful));
  EXPECT_TRUE(device::attached_devices()->empty());
  DiscoveryFilter filter;
  filter.vendor_id = 0x1234;
  filter.product_ids.clear();
  const auto found = device::attached_devices(filter);
  ASSERT_OK(found);
  ASSERT_EQ(found->size(), 1U);
  EXPECT_EQ(found->front().vendor_id, 0x1234);
  EXPECT_EQ(found->front().product_id, device::kMonitorProductId);
  EXPECT_EQ(found->front().model, "");
  filter.product_ids = {device::kJigProductId, device::kMonitorProductId};
  EXPECT_EQ(device::attached_devices(filter)->size(), 1U);
}

// Oracle: the ports in which the units were put; in the order of their names.
TEST_F(UsbDiscovery, ABenchOfManyUnitsIsListedInTheOrderOfItsPorts) {
  constexpr int kUnits = 20;
  std::vector<std::string> ports;
  for (int i = 0; i < kUnits; ++i) {
    const std::string port = "1-" + std::to_string(1 + i * 7 % kUnits);
    ASSERT_OK(bus->plug_in(make_unit(100 + static_cast<std::uint64_t>(i)).device, port));
    ports.push_back(port);
  }
  std::sort(ports.begin(), ports.end());
  std::vector<std::string> found;
  const auto devices = device::attached_devices();
  ASSERT_OK(devices);
  for (const auto& one : *devices) {
    EXPECT_TRUE(one.complete()) << one.port;
    found.push_back(one.port);
  }
  EXPECT_EQ(found, ports);
}

// Between finding and opening it the unit may be pulled out.
TEST_F(UsbDiscovery, AUnitThatWentAwayIsNotOpened) {
  ASSERT_OK(bus->plug_in(wilful, "1-2"));
  const auto found = device::find_device({}, clock);
  ASSERT_OK(found);
  EXPECT_OK(device::check_access(*found));
  EXPECT_EQ(*device::mount_point(*found), "") << "there is no block device";
  bus->unplug("1-2");
  EXPECT_FAILS(device::open_monitor(*found, posix_env()), ErrorCode::device_unavailable);
  const Status access = device::check_access(*found);
  EXPECT_FAILS(access, ErrorCode::device_unavailable);
  EXPECT_EQ(access.error().where, found->usb_node);
}

}  // namespace
}  // namespace sixpoint::tests
