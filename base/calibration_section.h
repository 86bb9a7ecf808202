// The calibration section of a unit's permanent memory, bytes 256 to 511: in eeprom.bin of the old
// form (gt3x/forms/eeprom.h) and in the page that a unit on USB keeps (device/wire).
//
//   SIXPOINT_ASSIGN(const CalibrationSection section, read_calibration_section(memory));
//   section.constants.zero_lsb;
//   write_calibration_section(section, memory);  // the other bytes stay
//
// The layout is public (the vendor's description of the NHANES release): "TUNE" at 256; int16 zero,
// positive and negative (X Y Z each), little-endian; at 278 six bytes of date; at 510 the
// CRC-CCITT of bytes 256 to 509, most significant byte first. The CRC was confirmed on a real
// image.
//
// The order within a date is not described: month, day, year - 2000, hour, minute, second, one byte
// each. The real images at hand are of October 2010, so they do not tell month and year apart; they
// confirm the other four.
//
// Pure functions; any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/result.h"
#include "base/stored_constants.h"
#include "base/time.h"

namespace sixpoint {

inline constexpr std::size_t kMemoryWithCalibration = 512;  // bytes, to the end of the section
inline constexpr std::size_t kMemoryDate = 6;               // bytes

struct CalibrationSection {
  StoredConstants constants;
  std::optional<UtcTime> calibrated;  // years 2000 to 2255; absent where it is no date
};

// bad_data for a memory that is too short or holds no such section, a CRC that fails, or constants
// outside their range.
Result<CalibrationSection> read_calibration_section(std::span<const std::uint8_t> memory);

// `memory` has kMemoryWithCalibration bytes or more. An absent date is written as an erased one.
void write_calibration_section(const CalibrationSection& section, std::span<std::uint8_t> memory);

// The first kMemoryDate bytes as a date; empty where they are none.
std::optional<UtcTime> read_memory_date(std::span<const std::uint8_t> bytes);

}  // namespace sixpoint
