// sixpoint devices: what is plugged in, and whether this user may use it; with --watch what comes
// and goes.
#include <csignal>
#include <set>
#include <thread>

#include <fmt/format.h>
#include <pthread.h>

#include "device/discovery.h"
#include "device/hotplug.h"
#include "station/cli/command.h"

namespace sixpoint::cli {
namespace {

struct Options {
  bool json = false;
  bool watch = false;
  std::optional<double> for_s;
};

// What a command would open it by; empty where there is nothing (a file monitor that is not
// mounted, a jig, a device without a serial number).
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

Json to_json(const device::AttachedDevice& attached) {
  const Status access = device::check_access(attached);
  const std::string address = address_of(attached);
  const bool unmounted = attached.product_id == device::kFileMonitorProductId && address.empty();
  Json json;
  json["address"] = address.empty() ? Json(nullptr) : Json(address);
  json["serial"] = attached.serial;
  json["model"] = attached.model;
  json["vendor_id"] = fmt::format("{:04x}", attached.vendor_id);
  json["product_id"] = fmt::format("{:04x}", attached.product_id);
  json["port"] = attached.port;
  json["usb_node"] = attached.usb_node;
  json["hidraw_node"] = attached.hidraw_node.empty() ? Json(nullptr) : Json(attached.hidraw_node);
  json["accessible"] = access.has_value();
  json["hint"] = !access ? Json(access.error().hint) : unmounted ? Json(kMountIt) : Json(nullptr);
  return json;
}

void tell(Context& context, const device::AttachedDevice& attached) {
  const Status access = device::check_access(attached);
  const std::string address = address_of(attached);
  const bool unmounted = attached.product_id == device::kFileMonitorProductId && address.empty();
  context.out << fmt::format("{:<24} {:<20} port {:<8} {}\n",
                             printable(address.empty() ? attached.serial : address),
                             attached.model.empty() ? "?" : attached.model, attached.port,
                             !access     ? access.error().what
                             : unmounted ? "not mounted"
                                         : "ready");
  if (!access) {
    context.people << fmt::format("  {}\n", access.error().brief());
  } else if (unmounted) {
    context.people << fmt::format("  {}: {}\n", attached.serial, kMountIt);
  }
}

device::DiscoveryFilter every_product() {
  device::DiscoveryFilter every;
  every.product_ids.clear();
  return every;
}

void list(const Options& options, Context& context) {
  const auto attached = device::attached_devices(every_product());
  if (!attached) {
    return report_error(context, "devices", attached.error(), options.json);
  }
  Json json = document("devices");
  json["devices"] = Json::array();
  for (const device::AttachedDevice& one : *attached) {
    if (options.json) {
      json["devices"].push_back(to_json(one));
    } else {
      tell(context, one);
    }
  }
  if (options.json) {
    print_json(context, json);
  } else if (attached->empty()) {
    context.people << "No device is plugged in. A unit in software: --device virtual:seed=7\n";
  }
}

// Lines as things happen, until Ctrl-C or --for: of JSON one document per event.
Status watch(const Options& options, Context& context) {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  sigset_t before;
  pthread_sigmask(SIG_BLOCK, &signals, &before);
  SIXPOINT_ASSIGN(const auto hotplug, device::HotplugWatch::start(every_product()));
  const auto start = context.env.clock.elapsed();
  constexpr std::chrono::milliseconds kSlice{200};  // how long Ctrl-C takes at most
  const timespec at_once{};
  Status status;
  while (::sigtimedwait(&signals, nullptr, &at_once) < 0 &&
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
      context.out << json.dump() << '\n';
    } else if (arrived) {
      context.out << "arrived  ";
      tell(context, one);
    } else {
      context.out << fmt::format("left     {:<24} {:<20} port {}\n", one.serial,
                                 one.model.empty() ? "?" : one.model, one.port);
    }
    context.out << std::flush;
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  return status;
}

void run(const Options& options, Context& context) {
  if (!options.watch) {
    return list(options, context);
  }
  if (const Status status = watch(options, context); !status) {
    report_error(context, "devices", status.error(), options.json);
  }
}

}  // namespace

void add_devices(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("devices", "List the devices that are plugged in");
  auto options = std::make_shared<Options>();
  command->add_flag("--json", options->json, "One JSON document on stdout");
  auto* watching = command->add_flag("--watch", options->watch,
                                     "Say what comes and goes until Ctrl-C; with --json one "
                                     "document per line");
  command->add_option("--for", options->for_s, "Watch so many seconds")
      ->check(CLI::Range(0.0, 1e9))
      ->needs(watching);
  command->callback([options, &context] { run(*options, context); });
}

}  // namespace sixpoint::cli
