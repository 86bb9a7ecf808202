#include "device/usb/discovery.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <libudev.h>
#include <mntent.h>
#include <unistd.h>

#include "device/usb/bulk_transport.h"
#include "device/usb/hid_transport.h"
#include "device/usb/usb_errors.h"

namespace sixpoint::device {

namespace {

struct Unref {
  void operator()(udev* context) const { udev_unref(context); }
  void operator()(udev_enumerate* list) const { udev_enumerate_unref(list); }
  void operator()(udev_device* device) const { udev_device_unref(device); }
};
using Udev = std::unique_ptr<udev, Unref>;
using Enumerate = std::unique_ptr<udev_enumerate, Unref>;
using Device = std::unique_ptr<udev_device, Unref>;

std::string_view attribute(udev_device* device, const char* name) {
  const char* text = udev_device_get_sysattr_value(device, name);
  return text == nullptr ? std::string_view() : std::string_view(text);
}

// 0 where there is no such number.
int number(std::string_view text, int base) {
  int value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value, base);
  return value;
}

// The serial comes from the device: what is no plain ASCII cannot be typed and names nothing.
std::string plain(std::string_view text) {
  const bool is_plain = text.size() <= 126 && std::all_of(text.begin(), text.end(), [](char c) {
                          return c > ' ' && c <= '~';
                        });
  return is_plain ? std::string(text) : std::string();
}

// Calls `visit` for each device of a subsystem.
Status for_each(udev* context, const char* subsystem,
                const std::function<void(udev_device*)>& visit) {
  const Enumerate list(udev_enumerate_new(context));
  if (!list || udev_enumerate_add_match_subsystem(list.get(), subsystem) < 0 ||
      udev_enumerate_scan_devices(list.get()) < 0) {
    return fail(ErrorCode::io, fmt::format("udev does not list the subsystem '{}'", subsystem),
                "/sys", "is /sys mounted?");
  }
  for (auto* entry = udev_enumerate_get_list_entry(list.get()); entry != nullptr;
       entry = udev_list_entry_get_next(entry)) {
    if (const Device device{
            udev_device_new_from_syspath(context, udev_list_entry_get_name(entry))}) {
      visit(device.get());  // else it went away meanwhile
    }
  }
  return {};
}

// Parents belong to the child and are not unreferenced. Null where there is none.
udev_device* usb_parent(udev_device* child, const char* type) {
  return udev_device_get_parent_with_subsystem_devtype(child, "usb", type);
}

// "/dev/hidraw3" by the path of the USB device that it belongs to.
Result<std::map<std::string, std::string>> hidraw_nodes(udev* context) {
  std::map<std::string, std::string> nodes;
  SIXPOINT_CHECK(for_each(context, "hidraw", [&](udev_device* node) {
    udev_device* interface = usb_parent(node, "usb_interface");
    udev_device* device = usb_parent(node, "usb_device");
    const char* name = udev_device_get_devnode(node);
    if (interface != nullptr && device != nullptr && name != nullptr &&
        number(attribute(interface, "bInterfaceNumber"), 16) == kHidInterface) {
      nodes[udev_device_get_syspath(device)] = name;
    }
  }));
  return nodes;
}

AttachedDevice read_device(udev_device* device, const std::map<std::string, std::string>& hidraw) {
  AttachedDevice found;
  found.vendor_id = static_cast<std::uint16_t>(number(attribute(device, "idVendor"), 16));
  found.product_id = static_cast<std::uint16_t>(number(attribute(device, "idProduct"), 16));
  found.serial = plain(attribute(device, "serial"));
  for (const UsbProduct& product : kUsbProducts) {
    if (found.vendor_id == kUsbVendorId && product.product_id == found.product_id) {
      found.model = product.model;
    }
  }
  found.port = udev_device_get_sysname(device);
  found.bus = number(attribute(device, "busnum"), 10);
  found.address = number(attribute(device, "devnum"), 10);
  if (const char* node = udev_device_get_devnode(device); node != nullptr) {
    found.usb_node = node;
  }
  if (const auto node = hidraw.find(udev_device_get_syspath(device)); node != hidraw.end()) {
    found.hidraw_node = node->second;
  }
  return found;
}

bool passes(const DiscoveryFilter& filter, const AttachedDevice& device) {
  const auto& ids = filter.product_ids;
  return device.vendor_id == filter.vendor_id &&
         (ids.empty() || std::find(ids.begin(), ids.end(), device.product_id) != ids.end()) &&
         (filter.serial.empty() || device.serial == filter.serial);
}

std::string names(const std::vector<AttachedDevice>& devices) {
  std::vector<std::string> list;
  list.reserve(devices.size());
  for (const AttachedDevice& device : devices) {
    list.push_back(device.serial.empty() ? "port " + device.port : device.serial);
  }
  return fmt::format("{}", fmt::join(list, ", "));
}

}  // namespace

bool AttachedDevice::complete() const {
  const bool has_hid = product_id != kFileMonitorProductId;
  return !usb_node.empty() && (!has_hid || !hidraw_node.empty());
}

Result<std::vector<AttachedDevice>> attached_devices(const DiscoveryFilter& filter) {
  const Udev context(udev_new());
  std::vector<AttachedDevice> devices;
  SIXPOINT_ASSIGN(const auto hidraw, hidraw_nodes(context.get()));
  SIXPOINT_CHECK(for_each(context.get(), "usb", [&](udev_device* device) {
    const char* type = udev_device_get_devtype(device);
    if (type == nullptr || std::string_view(type) != "usb_device") {
      return;
    }
    if (AttachedDevice found = read_device(device, hidraw); passes(filter, found)) {
      devices.push_back(std::move(found));
    }
  }));
  std::sort(devices.begin(), devices.end(),
            [](const AttachedDevice& a, const AttachedDevice& b) { return a.port < b.port; });
  return devices;
}

Result<AttachedDevice> find_device(const DiscoveryFilter& filter, Clock& clock) {
  constexpr auto kPatience = std::chrono::milliseconds(500);
  constexpr auto kStep = std::chrono::milliseconds(10);
  const auto deadline = clock.elapsed() + kPatience;
  for (;;) {
    SIXPOINT_ASSIGN(const auto found, attached_devices(filter));
    if (found.empty()) {
      DiscoveryFilter any = filter;
      any.serial.clear();
      SIXPOINT_ASSIGN(const auto others, attached_devices(any));
      return fail(ErrorCode::device_unavailable,
                  filter.serial.empty()
                      ? std::string("no such device is plugged in")
                      : fmt::format("no device with the serial number {} is plugged in",
                                    printable(filter.serial, 80)),
                  "USB",
                  others.empty() ? "plug it in; 'sixpoint devices' lists what is there"
                                 : fmt::format("plug it in, or use one of: {}", names(others)));
    }
    if (found.size() > 1) {
      if (filter.serial.empty()) {
        return fail(ErrorCode::usage, "several devices are plugged in", "USB",
                    fmt::format("name one by its serial number: {}", names(found)));
      }
      return fail(
          ErrorCode::device_unavailable,
          fmt::format("two devices have the serial number {}", printable(filter.serial, 80)),
          fmt::format("ports {} and {}", found[0].port, found[1].port), "unplug one of them");
    }
    if (found.front().complete()) {
      return found.front();
    }
    if (clock.elapsed() >= deadline) {
      return fail(ErrorCode::device_unavailable, "the kernel made no hidraw node for the device",
                  found.front().usb_node,
                  "load the kernel's drivers with 'modprobe hid-generic usbhid'");
    }
    clock.sleep(kStep);
  }
}

Status check_access(const AttachedDevice& device) {
  if (device.product_id == kFileMonitorProductId) {
    return {};
  }
  for (const std::string& node : {device.usb_node, device.hidraw_node}) {
    const bool wanted = !node.empty() || !device.complete();
    if (wanted && ::access(node.c_str(), R_OK | W_OK) != 0) {
      return usb_error(errno, "cannot use the device", node.empty() ? device.port : node);
    }
  }
  return {};
}

Result<std::string> mount_point(const AttachedDevice& device) {
  const Udev context(udev_new());
  std::vector<std::string> nodes;  // of the disk and of its partitions
  SIXPOINT_CHECK(for_each(context.get(), "block", [&](udev_device* block) {
    udev_device* usb = usb_parent(block, "usb_device");
    const char* node = udev_device_get_devnode(block);
    if (usb != nullptr && node != nullptr && device.port == udev_device_get_sysname(usb)) {
      nodes.emplace_back(node);
    }
  }));
  const std::unique_ptr<FILE, int (*)(FILE*)> mounts(::setmntent("/proc/self/mounts", "r"),
                                                     &::endmntent);
  std::array<char, 4096> text{};
  mntent mount{};
  while (mounts && ::getmntent_r(mounts.get(), &mount, text.data(), text.size()) != nullptr) {
    if (std::find(nodes.begin(), nodes.end(), mount.mnt_fsname) != nodes.end()) {
      return std::string(mount.mnt_dir);
    }
  }
  return std::string();
}

Result<Link> open_monitor(const AttachedDevice& monitor, Env& env) {
  Link link;
  link.clock = borrow_clock(env.clock);
  link.serial = monitor.serial;
  SIXPOINT_ASSIGN(link.bulk, open_bulk_transport({monitor.bus, monitor.address}, monitor.usb_node));
  SIXPOINT_ASSIGN(link.reports, open_hid_transport(monitor.hidraw_node));
  return link;
}

void register_usb(TransportRegistry& registry) {
  for (const char* scheme : {"hid", "usb"}) {
    registry.add(scheme, fmt::format("{}:SERIAL", scheme),
                 [](std::string_view rest, Env& env) -> Result<Link> {
                   DiscoveryFilter filter;
                   filter.serial = rest;
                   SIXPOINT_ASSIGN(const AttachedDevice monitor, find_device(filter, env.clock));
                   return open_monitor(monitor, env);
                 });
  }
}

}  // namespace sixpoint::device
