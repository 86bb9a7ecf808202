#include "device/usb/hotplug.h"

#include <algorithm>
#include <array>
#include <cerrno>

#include <libudev.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace sixpoint::device {

using std::chrono::nanoseconds;
using std::chrono::steady_clock;

struct HotplugWatch::Monitor {
  struct Unref {
    void operator()(udev* one) const { udev_unref(one); }
    void operator()(udev_monitor* one) const { udev_monitor_unref(one); }
  };
  ~Monitor() {
    if (cancel_fd >= 0) {
      ::close(cancel_fd);
    }
  }
  std::unique_ptr<udev, Unref> context{udev_new()};
  std::unique_ptr<udev_monitor, Unref> events;
  int cancel_fd = -1;
  bool cancelled = false;
};

bool is_still(const AttachedDevice& known, const AttachedDevice& seen) {
  return seen.port == known.port && seen.usb_node == known.usb_node &&
         seen.hidraw_node == known.hidraw_node &&
         (seen.serial == known.serial || seen.serial.empty());
}

HotplugWatch::HotplugWatch(DiscoveryFilter filter, std::unique_ptr<Monitor> monitor)
    : filter_(std::move(filter)), monitor_(std::move(monitor)) {}

HotplugWatch::~HotplugWatch() = default;

Result<std::unique_ptr<HotplugWatch>> HotplugWatch::start(DiscoveryFilter filter) {
  auto monitor = std::make_unique<Monitor>();
  monitor->cancel_fd = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  // "udev": events come when udevd is done with the device, and its access policy is in force.
  monitor->events.reset(udev_monitor_new_from_netlink(monitor->context.get(), "udev"));
  udev_monitor* const events = monitor->events.get();
  if (monitor->cancel_fd < 0 || events == nullptr ||
      udev_monitor_filter_add_match_subsystem_devtype(events, "usb", "usb_device") < 0 ||
      udev_monitor_filter_add_match_subsystem_devtype(events, "hidraw", nullptr) < 0 ||
      udev_monitor_enable_receiving(events) < 0) {
    return fail(ErrorCode::io, "udev's events cannot be received", "netlink",
                "does this machine or container allow netlink sockets?");
  }
  std::unique_ptr<HotplugWatch> watch(new HotplugWatch(std::move(filter), std::move(monitor)));
  SIXPOINT_CHECK(watch->scan());
  return watch;
}

Status HotplugWatch::scan() {
  SIXPOINT_ASSIGN(auto now, attached_devices(filter_));
  std::erase_if(now, [](const AttachedDevice& device) { return !device.complete(); });
  std::vector<AttachedDevice> stayed;
  for (AttachedDevice& device : known_) {
    if (std::any_of(now.begin(), now.end(),
                    [&](const AttachedDevice& seen) { return is_still(device, seen); })) {
      stayed.push_back(std::move(device));
    } else {
      events_.push_back({HotplugEvent::Kind::left, std::move(device)});
    }
  }
  known_ = std::move(stayed);
  for (AttachedDevice& device : now) {
    if (std::none_of(known_.begin(), known_.end(),
                     [&](const AttachedDevice& known) { return is_still(known, device); })) {
      events_.push_back({HotplugEvent::Kind::arrived, device});
      known_.push_back(std::move(device));
    }
  }
  return {};
}

Result<std::optional<HotplugEvent>> HotplugWatch::next(nanoseconds time_out) {
  // Without events (no udevd in a container) a scan every second finds what changed.
  constexpr nanoseconds kScanInterval = std::chrono::seconds(1);
  const auto deadline = steady_clock::now() + time_out;
  while (events_.empty() && !monitor_->cancelled) {
    const nanoseconds left = deadline - steady_clock::now();
    if (left <= nanoseconds::zero()) {
      return std::nullopt;
    }
    const auto wait = std::chrono::ceil<std::chrono::milliseconds>(std::min(left, kScanInterval));
    std::array<pollfd, 2> wake = {{{udev_monitor_get_fd(monitor_->events.get()), POLLIN, 0},
                                   {monitor_->cancel_fd, POLLIN, 0}}};
    if (::poll(wake.data(), wake.size(), static_cast<int>(wait.count())) < 0 && errno != EINTR) {
      return fail(ErrorCode::io, "udev's events cannot be received", "netlink", "try again");
    }
    if (wake[1].revents != 0) {
      monitor_->cancelled = true;
      break;
    }
    // Events that came together make one scan.
    while (udev_device* device = udev_monitor_receive_device(monitor_->events.get())) {
      udev_device_unref(device);
    }
    SIXPOINT_CHECK(scan());
  }
  if (monitor_->cancelled) {
    return std::nullopt;
  }
  std::optional<HotplugEvent> event(std::move(events_.front()));
  events_.pop_front();
  return event;
}

void HotplugWatch::cancel() {
  const std::uint64_t one = 1;
  static_cast<void>(::write(monitor_->cancel_fd, &one, sizeof(one)));
}

}  // namespace sixpoint::device
