// The nodes as poll() sees them. Oracle: Linux 6.1, usbdev_poll() (writable when a transfer can be
// reaped) and hidraw_poll() (readable when a report is there).
#include "device/wire/protocol.h"
#include "mocks/umockdev/umockdev_fixture.h"

namespace sixpoint::tests {
namespace {

constexpr int kNotNow_ms = 50;  // is_ready() waits so long before it says no

class UmockdevClient : public UmockdevTest {};

TEST_F(UmockdevClient, UsbfsIsWritableWhenATransferCanBeReaped) {
  const auto nodes = plug_in();
  const OpenFile usb(nodes.usb_node);
  EXPECT_FALSE(usb.is_ready(POLLOUT, kNotNow_ms));
  Transfer first(USBDEVFS_URB_TYPE_CONTROL, 0, Transfer::control_in({0x80, 8, 0, 0, 0, 0, 1, 0}));
  Transfer second(USBDEVFS_URB_TYPE_CONTROL, 0, Transfer::control_in({0x80, 8, 0, 0, 0, 0, 1, 0}));
  ASSERT_EQ(usb.ask(USBDEVFS_SUBMITURB, &first.urb), 0);
  ASSERT_EQ(usb.ask(USBDEVFS_SUBMITURB, &second.urb), 0);
  EXPECT_TRUE(usb.is_ready(POLLOUT));
  EXPECT_EQ(reap(usb), &first.urb);
  EXPECT_EQ(first.received(), Bytes{1}) << "the kernel has chosen configuration 1";
  EXPECT_TRUE(usb.is_ready(POLLOUT)) << "there is a second";
  EXPECT_EQ(reap(usb), &second.urb);
  EXPECT_FALSE(usb.is_ready(POLLOUT, kNotNow_ms));
}

TEST_F(UmockdevClient, HidrawIsReadableWhileThereIsAReport) {
  const auto nodes = plug_in();
  const OpenFile hid(nodes.hidraw_node);
  EXPECT_FALSE(hid.is_ready(POLLIN, kNotNow_ms));
  const auto request =
      device::encode({device::ReportKind::request, 1, device::Command::get_filter, {}, {}});
  Bytes numbered = {0};
  numbered.insert(numbered.end(), request.begin(), request.end());
  ASSERT_EQ(::write(hid.fd(), numbered.data(), numbered.size()), 65);
  EXPECT_TRUE(hid.is_ready(POLLIN));
  EXPECT_TRUE(hid.is_ready(POLLIN)) << "asking takes nothing away";
  Bytes buffer(device::kReportBytes);
  EXPECT_EQ(::read(hid.fd(), buffer.data(), buffer.size()), 64);
  EXPECT_FALSE(hid.is_ready(POLLIN, kNotNow_ms));
}

}  // namespace
}  // namespace sixpoint::tests
