#include "device/usb/usb_errors.h"

#include <cerrno>

#include <gmock/gmock.h>

namespace sixpoint::device {
namespace {

// The table of usb_errors.h.
TEST(UsbErrors, AnErrnoIsAnErrorWithAHint) {
  const std::vector<std::pair<int, ErrorCode>> rows = {
      {EACCES, ErrorCode::permission},
      {EPERM, ErrorCode::permission},
      {EBUSY, ErrorCode::device_unavailable},
      {ENODEV, ErrorCode::device_unavailable},
      {ENOENT, ErrorCode::device_unavailable},
      {ENXIO, ErrorCode::device_unavailable},
      {ESHUTDOWN, ErrorCode::device_unavailable},
      {EPIPE, ErrorCode::io},
      {ETIMEDOUT, ErrorCode::io},
      {EOVERFLOW, ErrorCode::bad_data},
      {EIO, ErrorCode::io},
      {ENOMEM, ErrorCode::io},
  };
  for (const auto& [number, code] : rows) {
    const Error error = usb_error(number, "cannot open the unit", "/dev/hidraw3").value();
    EXPECT_EQ(error.code, code) << number;
    EXPECT_THAT(error.what, testing::StartsWith("cannot open the unit: ")) << number;
    EXPECT_EQ(error.where, "/dev/hidraw3");
    EXPECT_FALSE(error.hint.empty()) << number;
  }
  EXPECT_THAT(usb_error(EACCES, "x", "y").value().hint, testing::HasSubstr(kAccessRules));
}

}  // namespace
}  // namespace sixpoint::device
