#include "station/devices.h"

#include "device/discovery.h"
#include "mocks/in_process.h"

namespace sixpoint::station {

device::TransportRegistry known_devices() {
  device::TransportRegistry registry;
  mocks::register_virtual(registry);
  device::register_usb(registry);
  return registry;
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
  return std::string(kScheme) + settings + (jig == "virtual" ? "jig=auto" : "jig=none");
}

}  // namespace sixpoint::station
