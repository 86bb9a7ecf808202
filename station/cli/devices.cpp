// sixpoint devices: what is plugged in, and whether this user may use it.
#include <fmt/format.h>

#include "device/discovery.h"
#include "station/cli/command.h"

namespace sixpoint::cli {
namespace {

Json to_json(const device::AttachedDevice& attached, const Status& access) {
  const bool monitor = attached.product_id == device::kMonitorProductId;
  Json json;
  json["address"] =
      monitor && !attached.serial.empty() ? Json("hid:" + attached.serial) : Json(nullptr);
  json["serial"] = attached.serial;
  json["model"] = attached.model;
  json["vendor_id"] = fmt::format("{:04x}", attached.vendor_id);
  json["product_id"] = fmt::format("{:04x}", attached.product_id);
  json["port"] = attached.port;
  json["usb_node"] = attached.usb_node;
  json["hidraw_node"] = attached.hidraw_node.empty() ? Json(nullptr) : Json(attached.hidraw_node);
  json["accessible"] = access.has_value();
  json["hint"] = access ? Json(nullptr) : Json(access.error().hint);
  return json;
}

void run(bool as_json, Context& context) {
  device::DiscoveryFilter every;
  every.product_ids.clear();
  const auto attached = device::attached_devices(every);
  if (!attached) {
    return report_error(context, "devices", attached.error(), as_json);
  }
  Json json = document("devices");
  json["devices"] = Json::array();
  for (const device::AttachedDevice& one : *attached) {
    const Status access = device::check_access(one);
    if (as_json) {
      json["devices"].push_back(to_json(one, access));
      continue;
    }
    context.out << fmt::format(
        "{:<24} {:<20} port {:<8} {}\n",
        one.product_id == device::kMonitorProductId ? "hid:" + one.serial : one.serial,
        one.model.empty() ? "?" : one.model, one.port, access ? "ready" : access.error().what);
    if (!access) {
      context.people << fmt::format("  {}\n", access.error().brief());
    }
  }
  if (as_json) {
    print_json(context, json);
  } else if (attached->empty()) {
    context.people << "No device is plugged in. A unit in software: --device virtual:seed=7\n";
  }
}

}  // namespace

void add_devices(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("devices", "List the devices that are plugged in");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "One JSON document on stdout");
  command->callback([json, &context] { run(*json, context); });
}

}  // namespace sixpoint::cli
