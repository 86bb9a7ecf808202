#include "cli/devices/known_devices.h"

#include <fmt/format.h>

#include "device/drive/drive_unit.h"
#include "device/jigs/hid_jig.h"
#include "device/session/session_replay.h"
#include "device/usb/discovery.h"
#include "device/wire/wire_unit.h"
#include "mocks/firmware/virtual_settings.h"
#include "mocks/in_process/in_process.h"
#include "mocks/in_process/virtual_hid_jig.h"

namespace sixpoint::station {

device::TransportRegistry known_devices() {
  device::TransportRegistry registry;
  mocks::register_virtual(registry);
  device::register_usb(registry);
  device::register_replay(registry);
  return registry;
}

device::UnitRegistry known_units() {
  device::UnitRegistry registry(
      known_devices(), [](device::Link link) { return device::WireUnit::open(std::move(link)); });
  device::register_drive(registry);
  return registry;
}

Status check_address(std::string_view device, Env& env) {
  constexpr std::string_view kVirtual = "virtual:";
  if (device.starts_with(kVirtual)) {
    const auto settings = mocks::parse_openable_settings(device.substr(kVirtual.size()), env.seed);
    return settings ? Status() : Status(fail(settings.error()));
  }
  if (device.starts_with("hid:") || device.starts_with("usb:")) {
    return {};  // whatever follows may be plugged in later
  }
  const auto link = known_devices().open(device, env);
  return link || link.error().code != ErrorCode::usage ? Status() : Status(fail(link.error()));
}

Result<device::Jig*> choose_jig(std::string_view name, device::Unit& unit, Env& env,
                                std::unique_ptr<device::Jig>& own) {
  if ((name.empty() || name == "virtual") && unit.jig() != nullptr) {
    return unit.jig();
  }
  if (name.empty() || name == "manual") {
    own = std::make_unique<device::ManualJig>();
    return own.get();
  }
  device::JigRegistry registry;
  device::register_hid_jig(registry);
  mocks::register_virtual_hid_jig(registry);
  SIXPOINT_ASSIGN(own, registry.open(name, env, unit));
  return own.get();
}

UnitWait wait_for_unit(device::Unit& unit, device::Jig& jig,
                       std::function<void(const std::string&)> report,
                       std::chrono::seconds patience) {
  static constexpr int kMostReturns = 5;
  return [&unit, &jig, report = std::move(report), patience, returns = 0](
             const Error& gone, const JigHooks::Look& look) mutable -> Result<UnitOnJig> {
    if (++returns > kMostReturns) {
      return fail(ErrorCode::device_unavailable,
                  fmt::format("the unit went away {} times", returns), gone.where,
                  "check its cable and battery, then begin again");
    }
    report(fmt::format("{}: waiting {} s for it to come back", gone.what, patience.count()));
    SIXPOINT_CHECK(unit.reconnect(patience, look));
    report("it is back; the run goes on");
    return UnitOnJig{&unit, &jig};
  };
}

std::string with_jig(std::string_view device, std::string_view jig) {
  constexpr std::string_view kScheme = "virtual:";
  if (jig.empty() || !device.starts_with(kScheme)) {
    return std::string(device);
  }
  // Every setting but the jig's own, in order.
  std::string settings;
  std::string_view rest = device.substr(kScheme.size());
  while (!rest.empty()) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    const std::string_view setting = rest.substr(0, comma);
    rest.remove_prefix(std::min(comma + 1, rest.size()));
    if (setting != "jig=auto" && setting != "jig=none") {
      settings += settings.empty() ? "" : ",";
      settings += setting;
    }
  }
  settings += settings.empty() ? "" : ",";
  return std::string(kScheme) + settings + (jig.starts_with("virtual") ? "jig=auto" : "jig=none");
}

}  // namespace sixpoint::station
