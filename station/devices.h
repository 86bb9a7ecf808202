// The devices that this program can open.
#pragma once

#include <string>
#include <string_view>

#include "device/transport.h"

namespace sixpoint::station {

// Every scheme this program was built with.
device::TransportRegistry known_devices();

// A device string with the jig asked for: `--jig virtual` on "virtual:seed=7" is
// "virtual:seed=7,jig=auto", and `--jig manual` takes a jig away. Other devices stay as they are.
std::string with_jig(std::string_view device, std::string_view jig);

}  // namespace sixpoint::station
