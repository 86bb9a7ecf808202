// The devices that this program can open, real and virtual.
//
//   SIXPOINT_ASSIGN(const auto unit, known_units().open("virtual:seed=7", env));
//   std::unique_ptr<device::Jig> own;
//   SIXPOINT_ASSIGN(device::Jig* const jig, choose_jig("manual", *unit, env, own));
//
// The jig lives as long as the unit or `own`. Every function may be called from any thread; the
// objects that they return belong to one thread at a time.
#pragma once

#include <string>
#include <string_view>

#include "device/jig_registry.h"
#include "device/transport.h"
#include "device/unit_registry.h"
#include "station/run/jig_session.h"

namespace sixpoint::station {

// All schemes: virtual, USB, replayed sessions.
device::TransportRegistry known_devices();

// The same, and mounted drives, which have no wire protocol.
device::UnitRegistry known_units();

// usage where no unit can ever be opened by this address: an unknown scheme or setting. A unit that
// is not plugged in, or a file that is not there, is none of its business.
Status check_address(std::string_view device, Env& env);

// The jig by its name:
//
//   name                        jig
//   "" or "virtual"             the one that is part of the unit, where it has one
//   "" or "manual"              a person turns the unit
//   another address             opened by its scheme: hid:SERIAL, virtual:lie_deg=8 ...
//
// `own` holds a jig that was opened here. usage for an unknown name (device/jig_registry.h).
Result<device::Jig*> choose_jig(std::string_view name, device::Unit& unit, Env& env,
                                std::unique_ptr<device::Jig>& own);

// JigHooks::reopen for a unit that was unplugged: waits until it is back and reports that through
// `report`. Gives up after `patience`, when another unit is plugged in, and at the sixth time.
// `unit` and `jig` must live longer than the result.
inline constexpr std::chrono::seconds kReturnPatience{30};  // time to plug a cable in again
using UnitWait = std::function<Result<UnitOnJig>(const Error&, const JigHooks::Look&)>;
UnitWait wait_for_unit(device::Unit& unit, device::Jig& jig,
                       std::function<void(const std::string&)> report,
                       std::chrono::seconds patience = kReturnPatience);

// The address of a virtual unit with the jig that was named:
//
//   device                     jig              result
//   virtual:seed=7             virtual ...      virtual:seed=7,jig=auto
//   virtual:seed=7,jig=auto    any other name   virtual:seed=7,jig=none
//   any                        ""               unchanged
//   of another scheme          any              unchanged
std::string with_jig(std::string_view device, std::string_view jig);

}  // namespace sixpoint::station
