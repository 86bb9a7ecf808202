#include "mocks/umockdev/umockdev_bus.h"

#include <sys/stat.h>

#include "device/usb/discovery.h"
#include "mocks/umockdev/umockdev_fixture.h"

namespace sixpoint::tests {
namespace {

class UmockdevBus : public UmockdevTest {
 protected:
  static unsigned mode_of(const std::string& node) {
    struct stat info {};
    EXPECT_EQ(::stat(node.c_str(), &info), 0) << node;
    return info.st_mode & 0777U;
  }
};

// Ports and nodes as Linux names them: bus-port, /dev/bus/usb/BUS/DEVICE with three digits. The
// root hub is device 1.
TEST_F(UmockdevBus, NamesPortsAndNodesAsTheKernelDoes) {
  const auto first = plug_in();
  EXPECT_EQ(first.port, "1-1");
  EXPECT_EQ(first.usb_node, "/dev/bus/usb/001/002");
  EXPECT_EQ(first.hidraw_node, "/dev/hidraw0");
  auto other = make_unit(8);
  const auto second = bus->plug_in(other.device, "1-4");
  ASSERT_OK(second);
  EXPECT_EQ(second->port, "1-4");
  EXPECT_EQ(second->usb_node, "/dev/bus/usb/001/003");
  EXPECT_EQ(second->hidraw_node, "/dev/hidraw1");
  EXPECT_FAILS(bus->plug_in(make_unit(9).device, "1-4"), ErrorCode::usage);
}

// Oracle: libudev, through the program's own search.
TEST_F(UmockdevBus, WhatIsPluggedInIsFoundAndWhatIsPulledOutIsNot) {
  const auto serials = [] {
    std::vector<std::string> found;
    const auto devices = device::attached_devices();
    EXPECT_OK(devices);
    for (const auto& device : devices.value()) {
      found.push_back(device.serial);
    }
    return found;
  };
  EXPECT_TRUE(serials().empty());
  const auto nodes = plug_in();
  EXPECT_EQ(serials(), std::vector<std::string>{unit.serial});
  bus->unplug("1-7");
  EXPECT_EQ(serials(), std::vector<std::string>{unit.serial}) << "another port";
  bus->unplug(nodes.port);
  EXPECT_TRUE(serials().empty());
  EXPECT_NE(::access(nodes.usb_node.c_str(), F_OK), 0);
  EXPECT_NE(::access(nodes.hidraw_node.c_str(), F_OK), 0);
  // The port is free again, and the numbers of nodes are new.
  const auto again = plug_in();
  EXPECT_EQ(again.port, nodes.port);
  EXPECT_EQ(again.usb_node, "/dev/bus/usb/001/003");
  EXPECT_EQ(again.hidraw_node, "/dev/hidraw1");
}

TEST_F(UmockdevBus, PermissionIsTakenAndGiven) {
  const auto nodes = plug_in();
  bus->allow(nodes.port, false);
  EXPECT_EQ(mode_of(nodes.usb_node), 0U);
  EXPECT_EQ(mode_of(nodes.hidraw_node), 0U);
  bus->allow(nodes.port, true);
  EXPECT_EQ(mode_of(nodes.usb_node), 0666U);
  EXPECT_EQ(mode_of(nodes.hidraw_node), 0666U);
}

}  // namespace
}  // namespace sixpoint::tests
