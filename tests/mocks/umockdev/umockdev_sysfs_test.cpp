// A unit in sysfs. Oracle: Linux, Documentation/ABI/stable/sysfs-bus-usb (names and number
// formats), and the table of docs/devices/wgt3x-bt-bench-unit.md (values).
#include <array>

#include <fmt/format.h>

#include "mocks/umockdev/umockdev_fixture.h"

namespace sixpoint::tests {
namespace {

Bytes content_of(const std::string& file) {
  const OpenFile opened(file, O_RDONLY);
  Bytes all;
  std::array<std::uint8_t, 4096> part{};
  for (;;) {
    const ssize_t count = ::read(opened.fd(), part.data(), part.size());
    if (count <= 0) {
      return all;
    }
    all.insert(all.end(), part.begin(), part.begin() + count);
  }
}

std::string text_of(const std::string& file) {
  const Bytes bytes = content_of(file);
  std::string text(bytes.begin(), bytes.end());
  while (!text.empty() && text.back() == '\n') {
    text.pop_back();
  }
  return text;
}

class UmockdevSysfs : public UmockdevTest {};

TEST_F(UmockdevSysfs, HasTheAttributesOfTheDevice) {
  const auto nodes = plug_in();
  const std::string device = "/sys/bus/usb/devices/" + nodes.port + "/";
  EXPECT_EQ(text_of(device + "idVendor"), "1209");
  EXPECT_EQ(text_of(device + "idProduct"), "0001");
  EXPECT_EQ(text_of(device + "manufacturer"), "Sixpoint");
  EXPECT_EQ(text_of(device + "product"), "Activity monitor");
  EXPECT_EQ(text_of(device + "serial"), unit.serial);
  EXPECT_EQ(text_of(device + "speed"), "480") << "Mbit/s, high speed";
  EXPECT_EQ(text_of(device + "busnum"), "1");
  EXPECT_EQ(text_of(device + "devnum"), "2");
  EXPECT_EQ(text_of(device + "bNumInterfaces"), " 3") << "two places, as the kernel writes it";
  // The bytes of the descriptors: the device's 18, then the configuration's with its own total.
  const Bytes descriptors = content_of(device + "descriptors");
  ASSERT_GT(descriptors.size(), 18U + 4U);
  EXPECT_EQ(descriptors[0], 18);
  EXPECT_EQ(descriptors[1], 1) << "DEVICE";
  EXPECT_EQ(descriptors[8] + 256 * descriptors[9], 0x1209);
  EXPECT_EQ(descriptors[18 + 1], 2) << "CONFIGURATION";
  EXPECT_EQ(descriptors[18 + 2] + 256U * descriptors[18 + 3], descriptors.size() - 18);
}

TEST_F(UmockdevSysfs, HasAFolderForEachInterface) {
  const auto nodes = plug_in();
  const char* const classes[] = {"03", "ff", "08"};
  for (int i = 0; i < 3; ++i) {
    const std::string folder = fmt::format("/sys/bus/usb/devices/{}:1.{}/", nodes.port, i);
    EXPECT_EQ(text_of(folder + "bInterfaceNumber"), fmt::format("0{}", i));
    EXPECT_EQ(text_of(folder + "bInterfaceClass"), classes[i]) << i;
  }
  const std::string storage = "/sys/bus/usb/devices/" + nodes.port + ":1.2/";
  EXPECT_EQ(text_of(storage + "bInterfaceSubClass"), "06") << "SCSI";
  EXPECT_EQ(text_of(storage + "bInterfaceProtocol"), "50") << "bulk only";
}

// The hidraw node leads to its HID device, whose uevent carries bus, ids and serial number: what
// hidapi reads.
TEST_F(UmockdevSysfs, TheHidrawNodeLeadsToItsDevice) {
  const auto nodes = plug_in();
  const std::string name = nodes.hidraw_node.substr(std::string("/dev/").size());
  const std::string uevent = text_of("/sys/class/hidraw/" + name + "/device/uevent");
  EXPECT_NE(uevent.find("HID_ID=0003:00001209:00000001"), std::string::npos) << uevent;
  EXPECT_NE(uevent.find("HID_UNIQ=" + unit.serial), std::string::npos) << uevent;
  EXPECT_NE(text_of("/sys/class/hidraw/" + name + "/uevent").find("DEVNAME="), std::string::npos);
}

}  // namespace
}  // namespace sixpoint::tests
