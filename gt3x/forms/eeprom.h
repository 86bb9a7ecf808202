// eeprom.bin of the old form: a unit's permanent memory, with the constants that it scales with.
//
//   SIXPOINT_ASSIGN(const UnitMemory memory, parse_eeprom(bytes));
//   memory.constants.zero_lsb;  // what the unit subtracted
//
// The layout is public (the vendor's description of the NHANES release): serial number at 0, the
// constants and their date from 256 on (base/calibration_section.h), in it the firmware at 349,
// little-endian. Confirmed on a real image, whose counts fit the constants by Eq. 1-6.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/stored_constants.h"
#include "base/time.h"

namespace sixpoint::gt3x {

struct UnitMemory {
  std::string serial;
  StoredConstants constants;
  std::optional<UtcTime> calibration_time;  // by the unit's clock; absent where it is no date
  std::string firmware;                     // "1.4.0"
};
// bad_data for what is too short, has no calibration section, a CRC that fails, or constants that
// no unit has.
Result<UnitMemory> parse_eeprom(std::span<const std::uint8_t> bytes);

inline constexpr std::size_t kOldBatteryEntry = 8;  // bytes
// One entry of battery.bin: six bytes of date, then millivolts, two bytes little-endian.
struct OldBatteryReading {
  UtcTime time;
  double battery_v = 0;
};
// Entries without a date (an erased or damaged part) are left out.
std::vector<OldBatteryReading> parse_old_battery(std::span<const std::uint8_t> bytes);

}  // namespace sixpoint::gt3x
