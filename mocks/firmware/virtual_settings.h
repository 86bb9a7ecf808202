// The text behind "virtual:": comma-separated settings, each key=value.
//
//   Result<VirtualSettings> settings = parse_virtual_settings("seed=7,jig=auto", 1);
//
//     serial, firmware, calibrated (2013-11-12), seed
//     noise: the seed of noise and seating alone: the same unit, measured another time
//     positive_lsb, negative_lsb, zero_lsb: what the memory holds, a/b/c
//     true_sensitivity_lsb_per_g, true_zero_lsb: what the sensor is under `current`, a/b/c
//     jig: auto (a virtual jig turns the unit), none
//     pace: fast (time passes as it is waited for), real (the machine's clock), 2 to 100 (so many
//       times the machine's clock)
//     interfaces: all, storage (mass storage alone, over USB/IP)
//     bad: zero_high, zero_low, sensitivity_low, sensitivity_high: a unit that must fail with that
//       code
//     battery_mv, temperature_c
//     jig_tilt_deg, misalignment_deg: the jig's base out of level, the sensor rotated in the case,
//       as rotation vectors a/b/c
//     faults: a fault plan's file, whose name holds no comma
//
// A setting that is missing comes from the seed, or is the default of VirtualUnitOptions.
#pragma once

#include <string_view>

#include "mocks/firmware/virtual_unit.h"

namespace sixpoint::mocks {

struct VirtualSettings {
  VirtualUnitOptions unit;
  bool with_jig = false;
  bool real_time = false;
  bool storage_only = false;  // takes no commands: cannot be opened by its settings
  std::string faults_file;    // empty: no faults
  int pace = 1;               // times the machine's clock, where it is real_time
};

// usage on an unknown key, a key given twice, or a value that no unit can have.
Result<VirtualSettings> parse_virtual_settings(std::string_view text, std::uint64_t default_seed);
// The same for a unit that will be opened: usage where it offers files alone.
Result<VirtualSettings> parse_openable_settings(std::string_view text, std::uint64_t default_seed);

}  // namespace sixpoint::mocks
