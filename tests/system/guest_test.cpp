// What runs inside the virtual machine: the bodies that also run over umockdev, and what only a
// real kernel can answer.
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>
#include <sys/mount.h>

#include "base/sha256.h"
#include "device/unit.h"
#include "device/usb/discovery.h"
#include "device/wire/payload.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "system/vhci_bench.h"
#include "temporary_folder.h"
#include "usb/bodies.h"

namespace sixpoint::tests {
namespace {

class System : public testing::TestWithParam<UsbBody> {};

TEST_P(System, Body) {
  VhciBench bench;
  GetParam().run(bench);
}

INSTANTIATE_TEST_SUITE_P(Usb, System, testing::ValuesIn(usb_bodies()),
                         [](const auto& one) { return std::string(one.param.name); });

INSTANTIATE_TEST_SUITE_P(Faults, System, testing::ValuesIn(usb_fault_bodies()),
                         [](const auto& one) { return std::string(one.param.name); });

std::string read_line(const std::string& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  return line;
}

std::string read_all(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream all;
  all << in.rdbuf();
  return all.str();
}

std::string driver_of(const std::string& interface) {
  std::error_code none;
  return std::filesystem::read_symlink("/sys/bus/usb/devices/" + interface + "/driver", none)
      .filename();
}

std::string output_of(const std::string& command) {
  FILE* pipe = ::popen(command.c_str(), "r");
  std::array<char, 4096> part{};
  std::string all;
  for (std::size_t count = 0; (count = std::fread(part.data(), 1, part.size(), pipe)) > 0;) {
    all.append(part.data(), count);
  }
  ::pclose(pipe);
  return all;
}

// The oracle is Linux: what it made of our descriptors, and which of its drivers took which part.
TEST(Kernel, TakesTheDescriptorsAndBindsItsDrivers) {
  VhciBench bench;
  BenchUnit unit = make_unit(7);
  ASSERT_OK(bench.plug_in(unit));
  const std::string device = "/sys/bus/usb/devices/" + unit.port;
  ASSERT_TRUE(wait_for_path(device + ":1.2/driver"));
  EXPECT_EQ(read_line(device + "/idVendor"), "1209");
  EXPECT_EQ(read_line(device + "/idProduct"), "0001");
  EXPECT_EQ(read_line(device + "/serial"), unit.serial);
  EXPECT_EQ(read_line(device + "/manufacturer"), "Sixpoint");
  EXPECT_EQ(read_line(device + "/bNumInterfaces"), " 3");
  EXPECT_EQ(read_line(device + "/bConfigurationValue"), "1");
  EXPECT_EQ(read_line(device + "/speed"), "480");
  EXPECT_EQ(driver_of(unit.port + ":1.0"), "usbhid");
  EXPECT_EQ(driver_of(unit.port + ":1.1"), "") << "left to libusb";
  EXPECT_EQ(driver_of(unit.port + ":1.2"), "usb-storage");
  ASSERT_TRUE(wait_for_path("/dev/hidraw0"));
}

// hidraw streams while usbfs carries a download of the same unit; no report is lost.
TEST(Kernel, HidrawAndUsbfsAtOnce) {
  VhciBench bench;
  BenchUnit bench_unit = make_unit(8);
  ASSERT_OK(bench.plug_in(bench_unit));
  ASSERT_TRUE(wait_for_path("/dev/hidraw0"));
  ASSERT_EQ(std::system("udevadm settle --timeout=10"), 0);
  device::TransportRegistry registry;
  device::register_usb(registry);
  auto link = registry.open(bench_unit.usb_address(), posix_env());
  ASSERT_OK(link);
  device::WireOptions patient;
  patient.reply_time_out = std::chrono::seconds(10);
  auto unit = device::WireUnit::open(std::move(*link), patient);
  ASSERT_OK(unit);
  ASSERT_OK((*unit)->start_recording(100, from_unix_seconds(1'500'000'000)));
  bench_unit.clock->forward(std::chrono::minutes(5));
  ASSERT_OK((*unit)->stop_recording());
  const auto recordings = (*unit)->recordings();
  ASSERT_OK(recordings);

  ASSERT_OK((*unit)->start_stream(30));
  const TemporaryFolder folder;
  ASSERT_OK((*unit)->download(recordings->front(), posix_env().files, folder / "all.gt3x"));
  const auto bytes = read_file(posix_env().files, folder / "all.gt3x");
  ASSERT_OK(bytes);
  EXPECT_EQ(sha256(*bytes), recordings->front().sha256);
  for (int i = 0; i < 10; ++i) {
    const auto block = (*unit)->next_samples(std::chrono::seconds(5));
    ASSERT_OK(block);
    ASSERT_TRUE(block->has_value());
  }
  EXPECT_EQ((*unit)->stream_statistics().lost_samples, 0U);
  EXPECT_EQ(driver_of(bench_unit.port + ":1.0"), "usbhid") << "no one took the HID driver off";
}

// Mounts the unit's volume at /mnt for as long as it lives.
class Mounted {
 public:
  explicit Mounted(const std::string& port) {
    const std::string hosts = "/sys/bus/usb/devices/" + port + ":1.2/";
    std::string disk;
    for (int i = 0; i < 1000 && disk.empty(); ++i) {
      disk = output_of("ls -d " + hosts + "host*/target*/*/block/* 2>/dev/null");
      if (disk.empty()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
      }
    }
    disk = disk.substr(0, disk.find('\n'));
    device_ = "/dev/" + disk.substr(disk.rfind('/') + 1);
    wait_for_path(device_);
    mounted_ = ::mount(device_.c_str(), "/mnt", "vfat", MS_RDONLY, "") == 0;
    if (!mounted_) {
      std::perror(device_.c_str());
    }
  }
  Mounted(const Mounted&) = delete;
  Mounted& operator=(const Mounted&) = delete;
  ~Mounted() {
    if (mounted_) {
      ::umount2("/mnt", MNT_DETACH);
    }
  }
  bool is_mounted() const { return mounted_; }
  const std::string& device() const { return device_; }

 private:
  std::string device_;
  bool mounted_ = false;
};

TEST(Kernel, MountsTheVolumeWithTheRecording) {
  VhciBench bench;
  BenchUnit unit = make_unit(9);
  {
    const std::lock_guard lock(unit.unit->mutex);
    const auto report = device::encode(
        {device::ReportKind::request,
         1,
         device::Command::start_recording,
         {},
         device::PayloadWriter().put(std::uint16_t{100}).put(std::uint32_t{1428588240}).take()});
    unit.unit->unit.take_report(report, unit.clock->elapsed());
    unit.clock->forward(std::chrono::minutes(10));
    unit.unit->unit.take_report(
        device::encode({device::ReportKind::request, 2, device::Command::stop_recording, {}, {}}),
        unit.clock->elapsed());
  }
  ASSERT_OK(bench.plug_in(unit));
  const Mounted volume(unit.port);
  ASSERT_TRUE(volume.is_mounted());
  EXPECT_EQ(output_of("ls /mnt"), "info.txt\nlog.bin\n");
  EXPECT_NE(read_all("/mnt/info.txt").find("Serial Number: " + unit.serial), std::string::npos);
  // 10 min of records of 9 + 450 bytes, byte for byte those of the recording: it is stored in its
  // archive as it is.
  const std::string text = read_all("/mnt/log.bin");
  const Bytes log(text.begin(), text.end());
  EXPECT_GT(log.size(), 600U * 459U);
  const Bytes& image = unit.unit->unit.recordings().front();
  EXPECT_NE(std::search(image.begin(), image.end(), log.begin(), log.end()), image.end());
  EXPECT_EQ(read_line("/sys/block/" + volume.device().substr(5) + "/ro"), "1");
  std::ofstream cannot("/mnt/new.txt");
  EXPECT_FALSE(cannot.good());
}

TEST(Kernel, UnpluggingAMountedVolumeEndsReadsWithAnError) {
  VhciBench bench;
  BenchUnit unit = make_unit(10);
  ASSERT_OK(bench.plug_in(unit));
  const Mounted volume(unit.port);
  ASSERT_TRUE(volume.is_mounted());
  bench.unplug(unit);
  EXPECT_TRUE(wait_for_path(volume.device(), false));
}

// Oracle: systemd-udevd itself, with packaging/udev and Debian's own rules.
TEST(Kernel, UdevRulesApply) {
  VhciBench bench;
  BenchUnit unit = make_unit(11);
  ASSERT_OK(bench.plug_in(unit));
  ASSERT_TRUE(wait_for_path("/dev/hidraw0"));
  ASSERT_EQ(std::system("udevadm settle --timeout=10"), 0);
  const std::string hid = output_of("udevadm info --query=property --name=/dev/hidraw0");
  EXPECT_NE(hid.find("ID_SIXPOINT=monitor\n"), std::string::npos) << hid;
  EXPECT_NE(hid.find(":uaccess:"), std::string::npos) << hid;
  const std::string usb =
      output_of("udevadm info --query=property --path=/sys/bus/usb/devices/" + unit.port);
  EXPECT_NE(usb.find("ID_SIXPOINT=monitor\n"), std::string::npos) << usb;
  EXPECT_NE(usb.find(":uaccess:"), std::string::npos) << usb;
}

}  // namespace
}  // namespace sixpoint::tests
