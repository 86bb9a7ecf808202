// What of discovery needs no bus: addresses, and a unit that is not the one that was found. The
// rest runs over umockdev and in qemu (tests/usb).
#include "device/usb/discovery.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/unit.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "mocks/in_process/in_process.h"
#include "open_files_limit.h"

namespace sixpoint::device {
namespace {

TEST(Discovery, ASerialThatNobodyHasIsUnavailable) {
  TransportRegistry registry;
  register_usb(registry);
  for (const char* address : {"hid:NO-SUCH-UNIT", "usb:NO-SUCH-UNIT"}) {
    EXPECT_FAILS(registry.open(address, posix_env()), ErrorCode::device_unavailable);
  }
  // Bytes from a command line reach no terminal as they are.
  const auto refused = registry.open("hid:\x1b[2J\n", posix_env());
  EXPECT_FAILS(refused, ErrorCode::device_unavailable);
  EXPECT_EQ(refused.error().what.find('\x1b'), std::string::npos);
}

TEST(Discovery, ADeviceIsCompleteWithTheNodesOfItsKind) {
  AttachedDevice monitor;
  monitor.product_id = kMonitorProductId;
  EXPECT_FALSE(monitor.complete());
  monitor.usb_node = "/dev/bus/usb/001/002";
  EXPECT_FALSE(monitor.complete()) << "hidraw comes a moment later";
  EXPECT_FAILS(check_access(monitor), ErrorCode::device_unavailable);
  AttachedDevice files = monitor;
  files.product_id = kFileMonitorProductId;
  EXPECT_TRUE(files.complete()) << "has no HID interface";
  monitor.hidraw_node = "/dev/hidraw0";
  EXPECT_TRUE(monitor.complete());
}

TEST(Discovery, AProgramWithTooManyOpenFilesIsToldSo) {
  const auto each = [](const auto& operation) {
    int refused = 0;
    for (;; ++refused) {
      const tests::OpenFilesLimit limit(refused);
      const auto result = operation();
      if (result) {
        break;
      }
      EXPECT_FAILS(result, ErrorCode::io);
      ASSERT_LT(refused, 100);
    }
    EXPECT_GE(refused, 1);
  };
  each([] { return attached_devices(); });
  each([] { return mount_point({}); });
}

// Another unit may be plugged in between finding a device and opening it.
TEST(Discovery, AUnitThatIsNotTheOneThatWasFoundIsRefused) {
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  const auto plugged =
      std::make_shared<mocks::PluggedUnit>(options, std::make_shared<ManualClock>());
  Link link = mocks::link_to(plugged, false);
  link.serial = options.truth.serial;
  EXPECT_OK(WireUnit::open(std::move(link)));
  link = mocks::link_to(plugged, false);
  link.serial = "MOS2A00000000";
  const auto refused = WireUnit::open(std::move(link));
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_NE(refused.error().what.find("MOS2A00000000"), std::string::npos);
}

}  // namespace
}  // namespace sixpoint::device
