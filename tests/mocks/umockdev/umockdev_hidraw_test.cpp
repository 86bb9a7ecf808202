// The hidraw node by its calls. Oracle: Linux, Documentation/hid/hidraw.rst, and HID 1.11.
#include <linux/hidraw.h>

#include "device/wire/protocol.h"
#include "mocks/umockdev/umockdev_fixture.h"

namespace sixpoint::tests {
namespace {

class UmockdevHidraw : public UmockdevTest {};

TEST_F(UmockdevHidraw, SaysWhatItIs) {
  const auto nodes = plug_in();
  const OpenFile hid(nodes.hidraw_node);
  hidraw_devinfo info{};
  ASSERT_GE(hid.ask(HIDIOCGRAWINFO, &info), 0);
  EXPECT_EQ(info.bustype, 3U) << "BUS_USB";
  EXPECT_EQ(info.vendor, 0x1209);
  EXPECT_EQ(info.product, 0x0001);
  std::array<char, 256> text{};
  EXPECT_EQ(hid.ask(HIDIOCGRAWUNIQ(256), text.data()), static_cast<int>(unit.serial.size()) + 1);
  EXPECT_EQ(text.data(), unit.serial);
  EXPECT_GT(hid.ask(HIDIOCGRAWPHYS(256), text.data()), 0);
  EXPECT_NE(std::string(text.data()).find("/input0"), std::string::npos);
  EXPECT_EQ(hid.ask(_IO('H', 99)), -ENOTTY);
}

// The same bytes as GET_DESCRIPTOR(report) of the device gives (HID 1.11, 7.1.1): a main item
// "input" (0x81) and one "output" (0x91), and the end of the collection (0xC0).
TEST_F(UmockdevHidraw, GivesTheReportDescriptorOfTheDevice) {
  const auto nodes = plug_in();
  const OpenFile hid(nodes.hidraw_node);
  int size = 0;
  ASSERT_GE(hid.ask(HIDIOCGRDESCSIZE, &size), 0);
  ASSERT_GT(size, 0);
  hidraw_report_descriptor descriptor{};
  descriptor.size = static_cast<std::uint32_t>(size);
  ASSERT_GE(hid.ask(HIDIOCGRDESC, &descriptor), 0);
  const Bytes bytes(descriptor.value, descriptor.value + size);
  EXPECT_EQ(bytes.back(), 0xC0);
  EXPECT_NE(std::find(bytes.begin(), bytes.end(), 0x81), bytes.end());
  EXPECT_NE(std::find(bytes.begin(), bytes.end(), 0x91), bytes.end());

  const OpenFile usb(nodes.usb_node);
  Transfer asked(USBDEVFS_URB_TYPE_CONTROL, 0,
                 Transfer::control_in({0x81, 6, 0x00, 0x22, 0, 0, 255, 0}));
  ASSERT_EQ(usb.ask(USBDEVFS_SUBMITURB, &asked.urb), 0);
  ASSERT_TRUE(usb.is_ready(POLLOUT));
  ASSERT_EQ(reap(usb), &asked.urb);
  EXPECT_EQ(asked.received(), bytes);
}

// A report goes out behind a byte 0, because reports have no number, and comes back without one.
TEST_F(UmockdevHidraw, CarriesARequestAndItsReply) {
  const auto nodes = plug_in();
  const OpenFile hid(nodes.hidraw_node);
  Bytes buffer(device::kReportBytes);
  EXPECT_EQ(::read(hid.fd(), buffer.data(), buffer.size()), -1);
  EXPECT_EQ(errno, EAGAIN);
  const auto request =
      device::encode({device::ReportKind::request, 7, device::Command::identify, {}, {}});
  Bytes numbered = {0};
  numbered.insert(numbered.end(), request.begin(), request.end());
  for (const std::size_t room : {64U, 10U}) {  // a shorter buffer gets the beginning
    ASSERT_EQ(::write(hid.fd(), numbered.data(), numbered.size()), 65);
    ASSERT_TRUE(hid.is_ready(POLLIN));
    buffer.assign(room, 0);
    ASSERT_EQ(::read(hid.fd(), buffer.data(), room), static_cast<ssize_t>(room));
    EXPECT_EQ(Bytes(buffer.begin(), buffer.begin() + 5), (Bytes{1, 2, 7, 0, 1})) << room;
    if (room == 64U) {
      const auto reply = device::decode(buffer);
      ASSERT_OK(reply);
      EXPECT_EQ(device::decode_identity(reply->payload)->serial, unit.serial);
    }
  }
  EXPECT_EQ(::read(hid.fd(), buffer.data(), buffer.size()), -1) << "what did not fit is gone";
  EXPECT_EQ(errno, EAGAIN);
}

}  // namespace
}  // namespace sixpoint::tests
