#include "mocks/usb/usb_device.h"

#include "usb_host.h"

namespace sixpoint::mocks {
namespace {

using Kind = UsbAnswer::Kind;

TEST(UsbDevice, ConfigurationStatusAndInterfaces) {
  UsbHost host;
  EXPECT_EQ(host.ask(0x80, 8, 0, 0, 1).bytes, Bytes{0});
  EXPECT_EQ(host.usb.in(0x81, 64).kind, Kind::stall) << "not configured";
  EXPECT_EQ(host.ask(0x81, 10, 0, 0, 1).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x00, 9, 2, 0, 0).kind, Kind::stall);
  host.configure();
  EXPECT_EQ(host.ask(0x80, 8, 0, 0, 1).bytes, Bytes{1});
  EXPECT_EQ(host.ask(0x80, 0, 0, 0, 2).bytes, (Bytes{1, 0})) << "self powered";
  EXPECT_EQ(host.ask(0x81, 0, 0, 2, 2).bytes, (Bytes{0, 0}));
  EXPECT_EQ(host.ask(0x81, 0, 0, 3, 2).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x81, 10, 0, 1, 1).bytes, Bytes{0});
  EXPECT_EQ(host.ask(0x01, 11, 0, 1, 0).kind, Kind::done);
  EXPECT_EQ(host.ask(0x01, 11, 1, 1, 0).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x00, 3, 1, 0, 0).kind, Kind::stall) << "no remote wakeup";
  EXPECT_EQ(host.ask(0x80, 5, 3, 0, 0).kind, Kind::stall) << "wrong direction";
  EXPECT_EQ(host.ask(0x40, 77, 0, 0, 0).kind, Kind::stall) << "no vendor requests";

  EXPECT_EQ(host.ask(0x82, 0, 0, 0x82, 2).bytes, (Bytes{0, 0}));
  EXPECT_EQ(host.ask(0x02, 3, 0, 0x82, 0).kind, Kind::done);
  EXPECT_EQ(host.ask(0x82, 0, 0, 0x82, 2).bytes, (Bytes{1, 0}));
  EXPECT_EQ(host.usb.in(0x82, 512).kind, Kind::stall);
  EXPECT_EQ(host.ask(0x02, 1, 0, 0x82, 0).kind, Kind::done);
  EXPECT_EQ(host.usb.in(0x82, 512).kind, Kind::nothing_yet);
  EXPECT_EQ(host.ask(0x82, 0, 0, 0x85, 2).kind, Kind::stall) << "no such endpoint";

  EXPECT_EQ(host.ask(0x21, 10, 0x0400, 0, 0).kind, Kind::done);
  EXPECT_EQ(host.ask(0xA1, 2, 0, 0, 1).bytes, Bytes{4}) << "GET_IDLE gives what SET_IDLE took";
  EXPECT_EQ(host.ask(0x21, 10, 0, 1, 0).kind, Kind::stall) << "interface 1 is no HID";
  host.ask(0x00, 9, 0, 0, 0);
  EXPECT_EQ(host.ask(0x80, 8, 0, 0, 1).bytes, Bytes{0});
}

// USB 2.0, 5.8.3: a transfer whose length is a multiple of the packet size ends with an empty
// packet.
TEST(TransferQueue, EndsOnThePacketBoundary) {
  TransferQueue queue(512);
  queue.put(Bytes(1024, 1));
  EXPECT_EQ(queue.next(512).bytes.size(), 512U);
  EXPECT_EQ(queue.next(512).bytes.size(), 512U);
  const UsbAnswer end = queue.next(512);
  EXPECT_EQ(end.kind, Kind::done);
  EXPECT_TRUE(end.bytes.empty());
  EXPECT_EQ(queue.next(512).kind, Kind::nothing_yet);
  queue.put(Bytes(1024, 1));
  EXPECT_EQ(queue.next(4096).bytes.size(), 1024U);
  EXPECT_EQ(queue.next(512).kind, Kind::nothing_yet) << "the host saw the empty packet";
}

}  // namespace
}  // namespace sixpoint::mocks
