// What of hotplug needs no bus: a system that refuses what the watch needs. The rest runs over
// umockdev and in qemu (tests/usb).
#include "device/usb/hotplug.h"

#include <chrono>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "open_files_limit.h"
#include "skip_unless.h"

namespace sixpoint::device {
namespace {

using tests::OpenFilesLimit;

// The rows of is_still(). A device that leaves was seen without its numbers while it left, and was
// said to have come again.
TEST(HotplugWatch, WhatIsLeftOfADeviceIsNoOther) {
  AttachedDevice known;
  known.serial = "MOS2A45130001";
  known.port = "1-1";
  known.bus = 1;
  known.address = 4;
  known.usb_node = "/dev/bus/usb/001/004";
  known.hidraw_node = "/dev/hidraw3";
  EXPECT_TRUE(is_still(known, known));
  AttachedDevice seen = known;
  seen.bus = 0;
  seen.address = 0;
  EXPECT_TRUE(is_still(known, seen));
  seen.serial.clear();
  EXPECT_TRUE(is_still(known, seen));
  seen.serial = "MOS2A45130002";
  EXPECT_FALSE(is_still(known, seen));
  for (std::string AttachedDevice::*member :
       {&AttachedDevice::port, &AttachedDevice::usb_node, &AttachedDevice::hidraw_node}) {
    seen = known;
    seen.*member += "1";
    EXPECT_FALSE(is_still(known, seen));
  }
}

TEST(HotplugWatch, AProgramWithTooManyOpenFilesIsToldSo) {
  SIXPOINT_SKIP_UNLESS(HotplugWatch::start().has_value(), "needs netlink sockets and /sys");
  int refused = 0;
  for (;; ++refused) {
    const OpenFilesLimit limit(refused);
    const auto watch = HotplugWatch::start();
    if (watch) {
      break;
    }
    EXPECT_FAILS(watch, ErrorCode::io);
    ASSERT_LT(refused, 100);
  }
  EXPECT_GE(refused, 2) << "an event descriptor and a socket";
}

// The watch itself goes on: what could not be asked is asked the next time.
TEST(HotplugWatch, AfterAnErrorItGoesOn) {
  SIXPOINT_SKIP_UNLESS(HotplugWatch::start().has_value(), "needs netlink sockets and /sys");
  const auto watch = HotplugWatch::start();
  ASSERT_OK(watch);
  {
    const OpenFilesLimit none(-1);  // the kernel refuses to wait for any
    EXPECT_FAILS((*watch)->next(std::chrono::hours(1)), ErrorCode::io);
  }
  const auto nothing = (*watch)->next(std::chrono::milliseconds(1));
  ASSERT_OK(nothing);
  EXPECT_FALSE(nothing->has_value());
}

}  // namespace
}  // namespace sixpoint::device
