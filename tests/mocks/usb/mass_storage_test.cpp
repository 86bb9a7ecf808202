#include "mocks/usb/mass_storage.h"

#include "usb_host.h"

namespace sixpoint::mocks {
namespace {

using Kind = UsbAnswer::Kind;

TEST(MassStorage, AnswersAHost) {
  UsbHost host;
  host.configure();
  UsbDisk disk(host.usb);
  EXPECT_EQ(host.ask(0xA1, 0xFE, 0, 2, 1).bytes, Bytes{0});
  EXPECT_EQ(host.ask(0xA1, 0xFE, 0, 1, 1).kind, Kind::stall);

  const DiskAnswer inquiry = disk.run({0x12, 0, 0, 0, 36, 0}, 36);
  ASSERT_EQ(inquiry.data.size(), 36U);
  EXPECT_EQ(inquiry.status, 0);
  EXPECT_EQ(inquiry.data[0], 0) << "a disk";
  EXPECT_EQ(inquiry.data[1], 0x80) << "removable";
  EXPECT_EQ(std::string(inquiry.data.begin() + 8, inquiry.data.end()),
            "SixpointActivity monitor1.0 ");
  EXPECT_EQ(disk.run({0x12, 0, 0, 0, 5, 0}, 5).data.size(), 5U);
  const DiskAnswer serial = disk.run({0x12, 1, 0x80, 0, 255, 0}, 255);
  EXPECT_EQ(std::string(serial.data.begin() + 4, serial.data.end()),
            host.plugged->unit.truth().serial);
  EXPECT_EQ(serial.residue, 255 - serial.data.size());

  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);
  const DiskAnswer capacity = disk.run({0x25, 0, 0, 0, 0, 0, 0, 0, 0, 0}, 8);
  EXPECT_EQ(capacity.data, (Bytes{0, 0x02, 0xFF, 0xFF, 0, 0, 2, 0})) << "96 MiB in blocks of 512";
  EXPECT_EQ(disk.run({0x23, 0, 0, 0, 0, 0, 0, 0, 12, 0}, 12).data,
            (Bytes{0, 0, 0, 8, 0, 3, 0, 0, 2, 0, 2, 0}));
  const DiskAnswer mode = disk.run({0x1A, 0, 0x3F, 0, 192, 0}, 192);
  EXPECT_EQ(mode.data, (Bytes{3, 0, 0x80, 0})) << "write protected";
  EXPECT_EQ(mode.residue, 188U);
  EXPECT_EQ(disk.run({0x1E, 0, 0, 0, 1, 0}, 0).status, 0);

  const Bytes boot = disk.read(0, 1);
  ASSERT_EQ(boot.size(), 512U);
  EXPECT_EQ(boot[510], 0x55);
  EXPECT_EQ(boot[511], 0xAA);
  const Bytes four = disk.read(0, 4);
  EXPECT_TRUE(std::equal(boot.begin(), boot.end(), four.begin()));

  // Errors: sense key, code and qualifier of SPC-2.
  const DiskAnswer beyond = disk.run({0x28, 0, 0, 2, 0xFF, 0xFF, 0, 0, 2, 0}, 1024);
  EXPECT_TRUE(beyond.stalled);
  EXPECT_EQ(beyond.status, 1);
  EXPECT_EQ(beyond.residue, 1024U);
  EXPECT_EQ(disk.sense(), (Bytes{5, 0x21, 0}));
  EXPECT_EQ(disk.sense(), (Bytes{0, 0, 0})) << "reported once";
  const DiskAnswer write = disk.run({0x2A, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 512, false);
  EXPECT_EQ(write.status, 1);
  EXPECT_EQ(disk.sense(), (Bytes{7, 0x27, 0}));
  EXPECT_EQ(disk.read(0, 1), boot) << "nothing was written";
  EXPECT_EQ(disk.run({0xEE, 0, 0, 0, 0, 0}, 0).status, 1);
  EXPECT_EQ(disk.sense(), (Bytes{5, 0x20, 0}));
}

// Bulk-only transport, 6.6 and 6.7.
TEST(MassStorage, FollowsTheTransport) {
  UsbHost host;
  host.configure();
  UsbDisk disk(host.usb);
  EXPECT_EQ(disk.run({0x28, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 0).status, 2) << "case 2: Hn < Di";
  const DiskAnswer long_host = disk.run({0x28, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 1024);
  EXPECT_EQ(long_host.data.size(), 512U) << "case 5: Hi > Di";
  EXPECT_EQ(long_host.residue, 512U);
  EXPECT_EQ(long_host.status, 0);
  const DiskAnswer short_host = disk.run({0x28, 0, 0, 0, 0, 0, 0, 0, 2, 0}, 512);
  EXPECT_EQ(short_host.status, 2) << "case 7: Hi < Di";
  EXPECT_EQ(disk.run({0x28, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 512, false).status, 2)
      << "case 10: Ho <> Di";
  const DiskAnswer no_data = disk.run({0, 0, 0, 0, 0, 0}, 64);
  EXPECT_TRUE(no_data.stalled) << "case 4: Hi > Dn";
  EXPECT_EQ(no_data.status, 0);
  EXPECT_EQ(no_data.residue, 64U);

  // The host's buffer ends with the last packet: only a stall ends the transfer.
  EXPECT_EQ(
      host.usb.out(0x03, disk.command_block({0x28, 0, 0, 0, 0, 0, 0, 0, 1, 0}, 2048, true)).kind,
      Kind::done);
  EXPECT_EQ(host.usb.in(0x83, 512).bytes.size(), 512U);
  EXPECT_EQ(host.usb.in(0x83, 512).kind, Kind::stall);
  host.ask(0x02, 1, 0, 0x83, 0);
  EXPECT_EQ(host.usb.in(0x83, 13).bytes.size(), 13U);

  // Invalid blocks halt both endpoints until the reset recovery (5.3.4).
  for (const Bytes& invalid : {Bytes(31, 0), Bytes(30, 'U'), Bytes(512, 1), Bytes{}}) {
    EXPECT_EQ(host.usb.out(0x03, invalid).kind, Kind::stall);
    EXPECT_EQ(host.usb.in(0x83, 13).kind, Kind::stall);
    host.ask(0x02, 1, 0, 0x83, 0);
    EXPECT_EQ(host.usb.in(0x83, 13).kind, Kind::stall) << "clearing the halt alone is not enough";
    EXPECT_EQ(host.ask(0x21, 0xFF, 0, 2, 0).kind, Kind::done);
    host.ask(0x02, 1, 0, 0x83, 0);
    host.ask(0x02, 1, 0, 0x03, 0);
    EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);
  }
  Bytes other_unit = disk.command_block({0, 0, 0, 0, 0, 0}, 0, true);
  other_unit[13] = 1;
  EXPECT_EQ(host.usb.out(0x03, other_unit).kind, Kind::stall) << "there is one logical unit";
}

TEST(MassStorage, ReportsEjectedAndChangedMedia) {
  UsbHost host;
  host.configure();
  UsbDisk disk(host.usb);
  EXPECT_EQ(disk.run({0x1B, 0, 0, 0, 2, 0}, 0).status, 0);
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 1);
  EXPECT_EQ(disk.sense(), (Bytes{2, 0x3A, 0}));
  EXPECT_EQ(disk.run({0x1B, 0, 0, 0, 3, 0}, 0).status, 0);
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);

  host.exchange(device::Command::start_recording,
                device::PayloadWriter().put(std::uint16_t{30}).put(std::uint32_t{1000000}).take());
  host.clock->sleep(std::chrono::seconds(10));
  host.exchange(device::Command::stop_recording);
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 1);
  EXPECT_EQ(disk.sense(), (Bytes{6, 0x28, 0})) << "the volume has another content";
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);
}

}  // namespace
}  // namespace sixpoint::mocks
