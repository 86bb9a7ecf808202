// The devices that this program can open.
#pragma once

#include <string>
#include <string_view>

#include "device/jig_registry.h"
#include "device/transport.h"
#include "device/unit_registry.h"
#include "station/jig_session.h"

namespace sixpoint::station {

// Every scheme this program was built with.
device::TransportRegistry known_devices();

// The same, and the devices that bring a protocol of their own.
device::UnitRegistry known_units();

// The jig that a person named: "" the one that is part of the device, or else a person; "manual";
// "virtual" the one that is part of a virtual unit; or an address such as hid:SERIAL or
// virtual:lie_deg=8 (device/jig_registry.h). `own` keeps what had to be opened. usage where the
// name is none.
Result<device::Jig*> choose_jig(std::string_view name, device::Unit& unit, Env& env,
                                std::unique_ptr<device::Jig>& own);

// JigHooks::reopen for one unit that stays the same object: waits for it to come back, tells
// people, and gives up after `patience`, when another unit comes, or when it goes away for the
// sixth time. `unit` and `jig` outlive what is returned.
inline constexpr std::chrono::seconds kReturnPatience{30};  // for a hand to find the cable
std::function<Result<UnitOnJig>(const Error&)> wait_for_unit(
    device::Unit& unit, device::Jig& jig, std::function<void(const std::string&)> tell,
    std::chrono::seconds patience = kReturnPatience);

// A device string with the jig asked for: `--jig virtual` on "virtual:seed=7" is
// "virtual:seed=7,jig=auto", and `--jig manual` takes a jig away. Other devices stay as they are.
std::string with_jig(std::string_view device, std::string_view jig);

}  // namespace sixpoint::station
