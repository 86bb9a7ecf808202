// A new kind of unit in one folder: a board that prints a line "x y z" of counts per sample, such
// as many do over a serial port. Here the lines come from a file, as `cat /dev/ttyACM0 > FILE`
// leaves it.
//
//   device::UnitRegistry registry({}, {});
//   register_lines(registry);
//   SIXPOINT_ASSIGN(const auto unit, registry.open("lines:recorded.txt", env));
//   SIXPOINT_CHECK(unit->start_stream(100));
//   SIXPOINT_ASSIGN(const auto block, unit->next_samples(std::chrono::seconds(1)));
//
// abilities() says that it streams and nothing else: what it does not have fails with `usage`
// without a line here. It becomes one of the program's by register_lines() in known_units()
// (cli/devices/known_devices.cpp).
#pragma once

#include "device/unit_registry.h"

namespace example {

// Registers "lines:FILE". bad_data for a line that is not three counts of 12 bits; at the end of
// the file the unit is gone (device_unavailable), as a board is whose cable was pulled.
void register_lines(sixpoint::device::UnitRegistry& registry);

}  // namespace example
