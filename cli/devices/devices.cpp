// sixpoint devices: which devices are plugged in, and whether this user may open them; with --watch
// the devices that arrive and leave.
#include <set>
#include <thread>

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/stop_request.h"
#include "device/usb/discovery.h"
#include "device/usb/hotplug.h"

namespace sixpoint::cli {
namespace {

struct DevicesCommandOptions {
  bool json = false;
  bool watch = false;
  std::optional<double> for_s;
};

// The address for --device; empty where there is none (a file monitor that is not mounted, a jig, a
// device without a serial number).
std::string address_of(const device::AttachedDevice& attached) {
  if (attached.product_id == device::kMonitorProductId && !attached.serial.empty()) {
    return "hid:" + attached.serial;
  }
  if (attached.product_id == device::kFileMonitorProductId) {
    const std::string folder = device::mount_point(attached).value_or("");
    return folder.empty() ? "" : "drive:" + folder;
  }
  return {};
}

constexpr const char* kMountIt = "mount it, then 'sixpoint capture --device drive:FOLDER'";

// One device as a user of this machine has it.
struct Standing {
  std::string address;  // of address_of()
  Status access;        // may this user open it?
  bool unmounted = false;
};

Standing standing_of(const device::AttachedDevice& attached) {
  Standing standing{address_of(attached), device::check_access(attached)};
  standing.unmounted =
      attached.product_id == device::kFileMonitorProductId && standing.address.empty();
  return standing;
}

Json to_json(const device::AttachedDevice& attached) {
  const Standing standing = standing_of(attached);
  return {{"address", text_or_null(standing.address)},
          {"serial", attached.serial},
          {"model", attached.model},
          {"vendor_id", fmt::format("{:04x}", attached.vendor_id)},
          {"product_id", fmt::format("{:04x}", attached.product_id)},
          {"port", attached.port},
          {"usb_node", attached.usb_node},
          {"hidraw_node", text_or_null(attached.hidraw_node)},
          {"accessible", standing.access.has_value()},
          {"hint", !standing.access     ? Json(standing.access.error().hint)
                   : standing.unmounted ? Json(kMountIt)
                                        : Json(nullptr)}};
}

// What a device says of itself is shown on one line, whatever it says.
std::string shown_model(const device::AttachedDevice& attached) {
  return attached.model.empty() ? "?" : printable(attached.model);
}

void print_devices(Context& context, const device::AttachedDevice& attached) {
  const auto [address, access, unmounted] = standing_of(attached);
  context.out << fmt::format("{:<24} {:<20} port {:<8} {}\n",
                             printable(address.empty() ? attached.serial : address),
                             shown_model(attached), attached.port,
                             !access     ? access.error().what
                             : unmounted ? "not mounted"
                                         : "ready");
  if (!access) {
    context.people << fmt::format("  {}\n", access.error().brief());
  } else if (unmounted) {
    context.people << fmt::format("  {}: {}\n", printable(attached.serial), kMountIt);
  }
}

device::DiscoveryFilter every_product() {
  device::DiscoveryFilter every;
  every.product_ids.clear();
  return every;
}

Status list(const DevicesCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(const auto attached, device::attached_devices(every_product()));
  Json json = document("devices");
  Json& devices = json["devices"] = Json::array();
  for (const device::AttachedDevice& one : attached) {
    if (options.json) {
      devices.push_back(to_json(one));
    } else {
      print_devices(context, one);
    }
  }
  if (options.json) {
    print_json(context, json);
  } else if (attached.empty()) {
    context.people << "No device is plugged in. A virtual unit: --device virtual:seed=7\n";
  }
  return {};
}

// One line per event until Ctrl-C or --for; with --json one document per line.
Status watch(const DevicesCommandOptions& options, Context& context) {
  sigset_t before;
  const sigset_t signals = block_stop_signals(&before);
  SIXPOINT_ASSIGN(const auto hotplug, device::HotplugWatch::start(every_product()));
  const auto start = context.env.clock.elapsed();
  constexpr std::chrono::milliseconds kSlice{200};  // how long Ctrl-C takes at most
  const timespec at_once{};
  Status status;
  int signal = -1;
  while ((signal = ::sigtimedwait(&signals, nullptr, &at_once)) < 0 &&
         (!options.for_s ||
          context.env.clock.elapsed() - start < std::chrono::duration<double>(*options.for_s))) {
    const auto event = hotplug->next(kSlice);
    if (!event) {
      status = fail(event.error());
      break;
    }
    if (!*event) {
      continue;
    }
    const bool arrived = (*event)->kind == device::HotplugEvent::Kind::arrived;
    const device::AttachedDevice& one = (*event)->device;
    if (options.json) {
      Json json = document("device-event");
      json["event"] = arrived ? "arrived" : "left";
      json["device"] = to_json(one);
      if (!arrived) {
        json["device"]["accessible"] = false;
        json["device"]["hint"] = nullptr;
      }
      context.out << json.dump(-1, ' ', false, Json::error_handler_t::replace) << '\n';
    } else if (arrived) {
      context.out << "arrived  ";
      print_devices(context, one);
    } else {
      context.out << fmt::format("left     {:<24} {:<20} port {}\n", printable(one.serial),
                                 shown_model(one), one.port);
    }
    context.out << std::flush;
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  take_stop(context, signal);
  return status;
}

Status run_devices(const DevicesCommandOptions& options, Context& context) {
  return options.watch ? watch(options, context) : list(options, context);
}

}  // namespace

void add_devices(CLI::App& app, Context& context) {
  auto [command, options] = add_command<DevicesCommandOptions>(
      app, context, "devices", "list the devices that are plugged in", run_devices);
  auto* watching = command.add_flag("--watch", options.watch,
                                    "print what arrives and leaves until Ctrl-C; with --json one "
                                    "document per line");
  command.add_option("--for", options.for_s, "watch so many seconds")
      ->check(CLI::Range(0.0, 1e9))
      ->needs(watching);
}

}  // namespace sixpoint::cli
