// The 512-byte page in which a unit keeps its nine constants (docs/protocol.md, "Memory pages").
//
//   SIXPOINT_ASSIGN(const Bytes bytes, encode_calibration_page({constants, calibrated}));
//   SIXPOINT_ASSIGN(const CalibrationPage page, decode_calibration_page(bytes));
//
// The layout is that of the public memory image of the GT3X+ family (base/calibration_section.h).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "base/env.h"
#include "device/unit_types.h"

namespace sixpoint::device {

inline constexpr std::size_t kPageBytes = 512;
inline constexpr std::uint8_t kCalibrationPage = 0;  // its number on the wire

// configuration when a constant does not fit into its field or the firmware would divide by zero
// (positive not above negative), or the date is outside the page's range.
//
// `before` is what the page holds now, or empty for a blank one: bytes outside the fields above are
// kept, because real units keep other things there.
Result<Bytes> encode_calibration_page(const CalibrationPage& page,
                                      std::span<const std::uint8_t> before = {});

// bad_data when length, pattern, CRC, constants or date do not hold.
Result<CalibrationPage> decode_calibration_page(std::span<const std::uint8_t> bytes);

}  // namespace sixpoint::device
