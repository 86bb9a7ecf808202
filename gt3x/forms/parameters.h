// The PARAMETERS record: how the unit was set up, and the constants it scales with.
//
//   SIXPOINT_ASSIGN(const Parameters parameters, parse_parameters(record.payload));
//   if (parameters.constants) {
//     parameters.constants->zero_lsb;  // what the unit subtracted
//   }
//
// The payload is a list of 8-byte entries, all little-endian: address space (2), identifier (2),
// value (4). The record usually stands once near the start; where it is repeated, the last one
// before a sample holds for that sample.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "base/env.h"
#include "base/stored_constants.h"
#include "base/time.h"

namespace sixpoint::gt3x {

using ParameterKey = std::pair<std::uint16_t, std::uint16_t>;  // address space, identifier
using ParameterValues = std::map<ParameterKey, std::uint32_t>;

// The entries that the program knows by name.
inline constexpr ParameterKey kParameterCalibrationTime = {0, 9};
inline constexpr ParameterKey kParameterFirmwareVersion = {0, 13};
inline constexpr ParameterKey kParameterAccelScale = {0, 55};
inline constexpr std::uint16_t kParameterUnitSpace = 1;
inline constexpr std::uint16_t kParameterNegative = 4;  // 4, 5, 6 for X, Y, Z
inline constexpr std::uint16_t kParameterPositive = 7;  // 7, 8, 9
inline constexpr ParameterKey kParameterSampleRate = {1, 10};
inline constexpr std::uint16_t kParameterZero = 15;           // 15, 16, 17
inline constexpr ParameterKey kParameterUtcOffset = {1, 40};  // seconds

struct Parameters {
  // Only when all nine are there and each lies in [-2048, 2047]. positive = negative is possible
  // here (has_zero_range() says so): Eq. 1-3 cannot be used with it.
  std::optional<StoredConstants> constants;
  std::optional<UtcTime> calibration_time;  // absent also where the unit wrote 0
  std::optional<double> accel_scale_lsb_per_g;
  std::optional<std::string> firmware;  // "1.5.0" from 0x01050000
  ParameterValues values;               // everything, known or not; of entries below the last value
  // Entries that stand twice, with two values. Which one holds is not known: neither is used above.
  std::set<ParameterKey> doubled;

  // Whether each of the nine numbers that it names is that of these constants; true where it names none.
  bool agrees_with(const StoredConstants& of_another) const;
  // An axis whose positive equals its negative reading, a division by zero in Eq. 1-3.
  bool has_zero_range() const;
};

// bad_data when the payload is no whole number of entries.
Result<Parameters> parse_parameters(std::span<const std::uint8_t> payload);

// The payload for these values, in ascending order of address space and identifier.
Bytes encode_parameters(const ParameterValues& values);

// Puts the nine integers into `values`.
void set_constants(ParameterValues& values, const StoredConstants& constants);

// Floating-point values in 32 bits: a 24-bit two's-complement fraction in units of 2^-23, and above
// it an 8-bit two's-complement exponent of 2. 0x007FFFFF and 0x00800000 stand for "too large"; they
// decode to the largest double, positive and negative, and encode_float() gives them for what does
// not fit. Below 2^-23 everything is 0 (vendor's public description).
double decode_float(std::uint32_t code);
std::uint32_t encode_float(double value);

// 0x01050000 -> "1.5.0" (major, minor, 16-bit build), and back; nullopt where the text is no such
// version.
std::string decode_firmware(std::uint32_t packed);
std::optional<std::uint32_t> encode_firmware(std::string_view version);

}  // namespace sixpoint::gt3x
