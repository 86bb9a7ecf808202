#include "mocks/usb/usb_drive.h"

#include "device/usb/usb_ids.h"
#include "expect_result.h"
#include "mocks/firmware/virtual_drive.h"
#include "usb_host.h"

namespace sixpoint::mocks {
namespace {

using Kind = UsbAnswer::Kind;

// The unit with mass storage alone: one interface, and the volume behind it.
TEST(UsbDrive, IsOneInterfaceWithItsVolume) {
  VirtualDriveOptions options;
  options.unit.truth = sim::draw_unit(7);
  const auto recording = virtual_drive_recording(options);
  ASSERT_OK(recording);
  VirtualUnit holder(options.unit);
  ASSERT_OK(holder.keep_recording(*recording, UtcTime{}));
  auto made = unit_volume(holder);
  ASSERT_OK(made);
  const auto volume = std::make_shared<const FatImage>(*std::move(made));
  UsbDrive drive(options.unit.truth, volume, std::make_shared<ManualClock>());
  EXPECT_EQ(drive.descriptors().product_id(), device::kFileMonitorProductId);
  EXPECT_EQ(drive.descriptors().serial(), options.unit.truth.serial);
  const auto configuration = parse_configuration(drive.descriptors().configuration);
  ASSERT_OK(configuration);
  ASSERT_EQ(configuration->interfaces.size(), 1U);
  EXPECT_EQ(configuration->interfaces[0].device_class, 8);
  EXPECT_EQ(configuration->endpoints.size(), 2U);

  drive.bus_reset();
  ASSERT_EQ(drive.control({0x00, 9, 1, 0, 0}, {}).kind, Kind::done);
  EXPECT_EQ(drive.control({0xA1, 0xFE, 0, 0, 1}, {}).bytes, Bytes{0});
  EXPECT_EQ(drive.out(0x01, Bytes(64)).kind, Kind::stall) << "no reports";
  UsbDisk disk(drive);
  const DiskAnswer inquiry = disk.run({0x12, 0, 0, 0, 36, 0}, 36);
  EXPECT_EQ(std::string(inquiry.data.begin() + 8, inquiry.data.end()),
            "SixpointFile monitor    1.0 ");
  for (std::uint32_t block = 0; block < 2000; block += 97) {
    std::array<std::uint8_t, kBlockBytes> wanted{};
    volume->read(block, wanted);
    EXPECT_EQ(disk.read(block, 1), Bytes(wanted.begin(), wanted.end())) << block;
  }
  // An invalid block halts it until the reset recovery, as the monitor's storage.
  EXPECT_EQ(drive.out(0x03, Bytes(30, 'U')).kind, Kind::stall);
  drive.control({0x02, 1, 0, 0x83, 0}, {});
  EXPECT_EQ(drive.in(0x83, 13).kind, Kind::stall);
  EXPECT_EQ(drive.control({0x21, 0xFF, 0, 0, 0}, {}).kind, Kind::done);
  drive.control({0x02, 1, 0, 0x83, 0}, {});
  drive.control({0x02, 1, 0, 0x03, 0}, {});
  EXPECT_EQ(disk.run({0, 0, 0, 0, 0, 0}, 0).status, 0);
  drive.unplug();
  EXPECT_EQ(drive.in(0x83, 13).kind, Kind::gone);
}

}  // namespace
}  // namespace sixpoint::mocks
