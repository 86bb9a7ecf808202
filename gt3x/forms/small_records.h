// What the small records of a log say: battery, light, skin contact, heart rate, temperature ...
//
//   SIXPOINT_ASSIGN(const std::uint8_t type, parse_record_type("BATTERY"));
//   small_record_columns(type);                    // {"battery_v"}
//   const Bytes payload = {0x68, 0x10};
//   SIXPOINT_ASSIGN(const auto rows, small_record_rows(type, payload, {}));
//   const std::string battery_v = rows[0][0];      // "4.2"
//
// By the vendor's public description of the .gt3x format:
//
// | type           | rows          | columns                                                    |
// |----------------|---------------|------------------------------------------------------------|
// | BATTERY        | one           | battery_v                                                  |
// | EVENT          | one           | code, payload                                              |
// | HEART_RATE_BPM | one           | heart_rate_bpm                                             |
// | LUX            | one           | lux (as stored; empty for 65535, which is no reading); of  |
// |                |               | lux.bin (old form): old_lux(), below                       |
// | METADATA       | one           | text                                                       |
// | TAG            | one a beacon  | beacon, transmit_power_db, received_db                     |
// | HEART_RATE_ANT | one a beat    | beat, previous_s, current_s                                |
// | CAPSENSE       | one           | signal, reference, worn (0 or 1), bursts                   |
// | TEMPERATURE    | one           | processor_adc, accelerometer_adc, processor_c,             |
// |                |               | accelerometer_c (empty without a calibration)              |
// | any other      | one           | payload                                                    |
//
// `payload` is hexadecimal. Values are texts as they stand in a CSV, quoted where needed.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "gt3x/forms/agdc.h"

namespace sixpoint::gt3x {

// By the name that `inspect` shows, or a number; usage for anything else, naming what there is.
Result<std::uint8_t> parse_record_type(std::string_view name);

std::vector<std::string> small_record_columns(std::uint8_t type);

// bad_data where the payload has another length than the type's.
Result<std::vector<std::vector<std::string>>> small_record_rows(
    std::uint8_t type, std::span<const std::uint8_t> payload,
    const std::optional<TemperatureCalibration>& temperature);

// A reading of lux.bin (old form) in lux, by the vendor's public description of that file:
//
// | the unit                      | below 20, and 65535 | any other reading                    |
// |-------------------------------|---------------------|--------------------------------------|
// | GT3X+ (NEO)                   | 0                   | 1.25 times the reading, 2500 at most |
// | ActiSleep+ (MRA)              | 0                   | 3.25 times the reading, 6000 at most |
// | any other                     | not known           | not known: it is not public          |
std::optional<double> old_lux(std::string_view serial, int reading);

}  // namespace sixpoint::gt3x
