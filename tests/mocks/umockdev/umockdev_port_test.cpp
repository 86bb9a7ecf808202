// What becomes of open files and of transfers under way when the device goes. Oracle: Linux 6.1,
// usbdev_remove() in drivers/usb/core/devio.c, and drivers/hid/hidraw.c.
#include <linux/hidraw.h>

#include "mocks/umockdev/umockdev_fixture.h"

namespace sixpoint::tests {
namespace {

class UmockdevPort : public UmockdevTest {};

TEST_F(UmockdevPort, TransfersUnderWayComeBackWhenTheDeviceGoes) {
  const auto nodes = plug_in();
  const OpenFile usb(nodes.usb_node);
  Transfer first(USBDEVFS_URB_TYPE_BULK, 0x82, Bytes(512));
  Transfer second(USBDEVFS_URB_TYPE_BULK, 0x82, Bytes(512));
  ASSERT_EQ(usb.ask(USBDEVFS_SUBMITURB, &first.urb), 0);
  ASSERT_EQ(usb.ask(USBDEVFS_SUBMITURB, &second.urb), 0);
  bus->unplug(nodes.port);
  // USBDEVFS_CAP_REAP_AFTER_DISCONNECT: they are reaped from a device that is no longer there.
  ASSERT_TRUE(usb.is_ready(POLLOUT));
  EXPECT_EQ(reap(usb), &first.urb) << "in the order in which they were submitted";
  EXPECT_EQ(first.urb.status, -ESHUTDOWN);
  EXPECT_EQ(reap(usb), &second.urb);
  EXPECT_EQ(second.urb.status, -ESHUTDOWN);
  EXPECT_EQ(reap(usb), nullptr);
  EXPECT_EQ(errno, ENODEV);
  unsigned interface = 1;
  EXPECT_EQ(usb.ask(USBDEVFS_CLAIMINTERFACE, &interface), -ENODEV);
  EXPECT_EQ(usb.ask(USBDEVFS_SUBMITURB, &first.urb), -ENODEV);
}

TEST_F(UmockdevPort, ReadersOfReportsWakeWhenTheDeviceGoes) {
  const auto nodes = plug_in();
  const OpenFile hid(nodes.hidraw_node);
  Bytes buffer(64);
  EXPECT_EQ(::read(hid.fd(), buffer.data(), buffer.size()), -1);
  EXPECT_EQ(errno, EAGAIN);
  bus->unplug(nodes.port);
  EXPECT_TRUE(hid.is_ready(POLLIN));
  EXPECT_EQ(::read(hid.fd(), buffer.data(), buffer.size()), -1);
  EXPECT_EQ(errno, EIO);
  buffer.assign(65, 0);
  EXPECT_EQ(::write(hid.fd(), buffer.data(), buffer.size()), -1);
  EXPECT_EQ(errno, ENODEV);
  hidraw_devinfo info{};
  EXPECT_EQ(hid.ask(HIDIOCGRAWINFO, &info), -ENODEV);
}

// The kernel chooses the first configuration of a new device (USB 2.0, 9.4.7), also of one that was
// plugged in before.
TEST_F(UmockdevPort, ANewDeviceIsConfigured) {
  for (int i = 0; i < 2; ++i) {
    const auto nodes = plug_in();
    const OpenFile usb(nodes.usb_node);
    Transfer asked(USBDEVFS_URB_TYPE_CONTROL, 0, Transfer::control_in({0x80, 8, 0, 0, 0, 0, 1, 0}));
    ASSERT_EQ(usb.ask(USBDEVFS_SUBMITURB, &asked.urb), 0);
    ASSERT_TRUE(usb.is_ready(POLLOUT));
    ASSERT_EQ(reap(usb), &asked.urb);
    EXPECT_EQ(asked.received(), Bytes{1});
    bus->unplug(nodes.port);
  }
}

}  // namespace
}  // namespace sixpoint::tests
