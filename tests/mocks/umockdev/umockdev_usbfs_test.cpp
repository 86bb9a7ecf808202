// The node of usbfs by its ioctls. Oracle: Linux 6.1, drivers/usb/core/devio.c (what each call is
// refused with), and USB 2.0, chapter 9 (what the device answers).
#include "mocks/umockdev/umockdev_fixture.h"

namespace sixpoint::tests {
namespace {

constexpr unsigned kHid = 0;
constexpr unsigned kBulk = 1;

class UmockdevUsbfs : public UmockdevTest {
 protected:
  static int claim(const OpenFile& usb, unsigned interface) {
    return usb.ask(USBDEVFS_CLAIMINTERFACE, &interface);
  }
  static int release(const OpenFile& usb, unsigned interface) {
    return usb.ask(USBDEVFS_RELEASEINTERFACE, &interface);
  }
  // The driver's name, or the errno.
  static std::string driver(const OpenFile& usb, unsigned interface) {
    usbdevfs_getdriver asked{};
    asked.interface = interface;
    const int answer = usb.ask(USBDEVFS_GETDRIVER, &asked);
    return answer < 0 ? std::strerror(-answer) : asked.driver;
  }
  static int on_driver(const OpenFile& usb, unsigned interface, unsigned long code) {
    usbdevfs_ioctl command{static_cast<int>(interface), static_cast<int>(code), nullptr};
    return usb.ask(USBDEVFS_IOCTL, &command);
  }
};

TEST_F(UmockdevUsbfs, AnInterfaceHasOneOwner) {
  const auto nodes = plug_in();
  OpenFile first(nodes.usb_node);
  const OpenFile second(nodes.usb_node);
  EXPECT_EQ(claim(first, 9), -ENOENT);
  EXPECT_EQ(claim(first, kHid), -EBUSY) << "usbhid has it";
  EXPECT_EQ(claim(first, kBulk), 0);
  EXPECT_EQ(claim(first, kBulk), 0) << "a second time";
  EXPECT_EQ(claim(second, kBulk), -EBUSY);
  EXPECT_EQ(release(second, kBulk), -EINVAL) << "not its own";
  EXPECT_EQ(release(first, kBulk), 0);
  EXPECT_EQ(release(first, kBulk), -EINVAL);
  EXPECT_EQ(claim(second, kBulk), 0);
}

TEST_F(UmockdevUsbfs, DriversAreNamedDetachedAndAttached) {
  const auto nodes = plug_in();
  const OpenFile usb(nodes.usb_node);
  EXPECT_EQ(driver(usb, kHid), "usbhid");
  EXPECT_EQ(driver(usb, 2), "usb-storage");
  EXPECT_EQ(driver(usb, kBulk), std::strerror(ENODATA)) << "none for a vendor's class";
  ASSERT_EQ(claim(usb, kBulk), 0);
  EXPECT_EQ(driver(usb, kBulk), "usbfs");
  EXPECT_EQ(on_driver(usb, kHid, USBDEVFS_DISCONNECT), 0);
  EXPECT_EQ(on_driver(usb, kHid, USBDEVFS_DISCONNECT), -ENODATA);
  EXPECT_EQ(driver(usb, kHid), std::strerror(ENODATA));
  EXPECT_EQ(claim(usb, kHid), 0);
  EXPECT_EQ(release(usb, kHid), 0);
  EXPECT_GE(on_driver(usb, kHid, USBDEVFS_CONNECT), 0);
  EXPECT_EQ(driver(usb, kHid), "usbhid");
  EXPECT_EQ(claim(usb, kHid), -EBUSY);
  EXPECT_EQ(usb.ask(_IO('U', 99)), -ENOTTY);
}

// GET_DESCRIPTOR of the device (18 bytes), and of a string that there is not.
TEST_F(UmockdevUsbfs, AControlTransferComesBackWithItsAnswer) {
  const auto nodes = plug_in();
  const OpenFile usb(nodes.usb_node);
  Transfer asked(USBDEVFS_URB_TYPE_CONTROL, 0,
                 Transfer::control_in({0x80, 6, 0x00, 0x01, 0, 0, 64, 0}));
  ASSERT_EQ(usb.ask(USBDEVFS_SUBMITURB, &asked.urb), 0);
  ASSERT_TRUE(usb.is_ready(POLLOUT));
  EXPECT_EQ(reap(usb), &asked.urb);
  EXPECT_EQ(asked.urb.status, 0);
  ASSERT_EQ(asked.urb.actual_length, 18);
  const Bytes device = asked.received();
  EXPECT_EQ(Bytes(device.begin() + 8, device.begin() + 12), (Bytes{0x09, 0x12, 0x01, 0x00}));

  Transfer none(USBDEVFS_URB_TYPE_CONTROL, 0,
                Transfer::control_in({0x80, 6, 0xEE, 0x03, 0x09, 0x04, 64, 0}));
  ASSERT_EQ(usb.ask(USBDEVFS_SUBMITURB, &none.urb), 0);
  ASSERT_TRUE(usb.is_ready(POLLOUT));
  EXPECT_EQ(reap(usb), &none.urb);
  EXPECT_EQ(none.urb.status, -EPIPE) << "stalled";
  EXPECT_EQ(none.urb.actual_length, 0);
}

TEST_F(UmockdevUsbfs, ATransferThatCannotBeIsRefused) {
  const auto nodes = plug_in();
  const OpenFile usb(nodes.usb_node);
  Transfer elsewhere(USBDEVFS_URB_TYPE_BULK, 0x87, Bytes(64));
  EXPECT_EQ(usb.ask(USBDEVFS_SUBMITURB, &elsewhere.urb), -ENOENT) << "no such endpoint";
  Transfer held(USBDEVFS_URB_TYPE_INTERRUPT, 0x81, Bytes(64));
  EXPECT_EQ(usb.ask(USBDEVFS_SUBMITURB, &held.urb), -EBUSY) << "its interface is the driver's";
  Transfer isochronous(USBDEVFS_URB_TYPE_ISO, 0x82, Bytes(64));
  EXPECT_EQ(usb.ask(USBDEVFS_SUBMITURB, &isochronous.urb), -EINVAL);
  Transfer brief(USBDEVFS_URB_TYPE_CONTROL, 0, Bytes(7));
  EXPECT_EQ(usb.ask(USBDEVFS_SUBMITURB, &brief.urb), -EINVAL) << "no whole setup packet";
  EXPECT_EQ(reap(usb), nullptr);
  EXPECT_EQ(errno, EAGAIN);
}

// A transfer that waits is taken back: it is reaped with ENOENT, and is not there a second time.
TEST_F(UmockdevUsbfs, AWaitingTransferIsDiscarded) {
  const auto nodes = plug_in();
  const OpenFile usb(nodes.usb_node);
  Transfer waiting(USBDEVFS_URB_TYPE_BULK, 0x82, Bytes(512));
  ASSERT_EQ(usb.ask(USBDEVFS_SUBMITURB, &waiting.urb), 0);
  EXPECT_EQ(driver(usb, kBulk), "usbfs") << "the kernel claims for a program that did not";
  EXPECT_EQ(reap(usb), nullptr);
  EXPECT_EQ(usb.ask(USBDEVFS_DISCARDURB, &waiting.urb), 0);
  EXPECT_EQ(usb.ask(USBDEVFS_DISCARDURB, &waiting.urb), -EINVAL);
  EXPECT_EQ(reap(usb), &waiting.urb);
  EXPECT_EQ(waiting.urb.status, -ENOENT);
  EXPECT_EQ(reap(usb), nullptr);
}

// CLEAR_FEATURE(ENDPOINT_HALT) of USB 2.0, 9.4.1, by the ioctl.
TEST_F(UmockdevUsbfs, AHaltIsClearedOnAnEndpointThatThereIs) {
  const auto nodes = plug_in();
  const OpenFile usb(nodes.usb_node);
  unsigned endpoint = 0x82;
  EXPECT_EQ(usb.ask(USBDEVFS_CLEAR_HALT, &endpoint), 0);
  endpoint = 0x8A;
  EXPECT_LT(usb.ask(USBDEVFS_CLEAR_HALT, &endpoint), 0);
}

}  // namespace
}  // namespace sixpoint::tests
