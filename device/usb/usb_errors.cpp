#include "device/usb/usb_errors.h"

#include <cerrno>
#include <system_error>

#include <fmt/format.h>

namespace sixpoint::device {

tl::unexpected<Error> usb_error(int error_number, const std::string& what,
                                const std::string& node) {
  const auto say = [&](const char* reason) { return fmt::format("{}: {}", what, reason); };
  switch (error_number) {
    case EACCES:
    case EPERM:
      return fail(
          ErrorCode::permission, say("permission denied"), node,
          fmt::format("install packaging/udev/{} and {} into /etc/udev/rules.d, run 'udevadm "
                      "control --reload', and plug the device in again",
                      kDetectionRules, kAccessRules));
    case EBUSY:
      return fail(ErrorCode::device_unavailable, say("another program holds it"), node,
                  fmt::format("close that program; 'fuser -v {}' names it", node));
    case ENODEV:
    case ENOENT:
    case ENXIO:
    case ESHUTDOWN:
      return fail(ErrorCode::device_unavailable, say("it was unplugged"), node, "plug it in again");
    case EPIPE:
      return fail(ErrorCode::io, say("the endpoint stalled"), node,
                  "try again; if it stays, plug the device in again");
    case ETIMEDOUT:
      return fail(ErrorCode::io, say("the device did not take it in time"), node,
                  "plug the device in again");
    case EOVERFLOW:
      return fail(ErrorCode::bad_data, say("the device sent more than it may"), node,
                  "plug the device in again; if it stays, its firmware is faulty");
    default:
      return fail(ErrorCode::io, say(std::generic_category().message(error_number).c_str()), node,
                  "try another cable and another port, without a hub between");
  }
}

}  // namespace sixpoint::device
