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
