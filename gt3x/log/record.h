// One record of log.bin.
//
//   Bytes log;
//   append_record(log, RecordType::battery, 1'400'000'000, Bytes{0x68, 0x10});  // 4200 mV
//   record_type_name(log[1]);                                                   // "BATTERY"
//
// On disk (vendor's public description of the .gt3x format): separator 0x1E, type (1 byte), Unix
// time (4 bytes, little-endian), payload size (2, little-endian), payload, checksum (1): the one's
// complement of the exclusive-or of everything before it. Times are the wearer's local time written
// as if it were UTC, as the vendor's software set them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/env.h"

namespace sixpoint::gt3x {

enum class RecordType : std::uint8_t {
  activity = 0,  // one second of 12-bit samples, Y X Z
  ant_plus = 1,
  battery = 2,  // millivolts, 2 bytes
  event = 3,    // one byte 0x08 enters idle sleep, 0x09 leaves it; others are diagnostics
  heart_rate_bpm = 4,
  lux = 5,
  metadata = 6,  // JSON text
  tag = 7,
  temperature_old = 8,  // named by the vendor, its content is not described
  epoch = 9,
  daily_summary = 10,
  heart_rate_ant = 11,
  epoch2 = 12,
  capsense = 13,
  heart_rate_ble = 14,
  epoch3 = 15,
  epoch4 = 16,
  imu_9dof = 17,
  magnetometer = 18,
  fifo_error = 19,
  fifo_dump = 20,
  parameters = 21,  // parameters.h
  imu_accelerometer = 22,
  debug = 23,
  sensor_schema = 24,  // forms/sensor_schema.h
  sensor_data = 25,
  activity2 = 26,    // one second of 16-bit samples, X Y Z
  activity3 = 27,    // .agdc: one second of 12-bit raw sensor counts, X Y Z
  temperature = 30,  // .agdc: forms/agdc.h
};

// "ACTIVITY", "PARAMETERS" ...; "TYPE_29" for one that has no name here.
std::string record_type_name(std::uint8_t type);

inline constexpr std::uint8_t kSeparator = 0x1E;
inline constexpr std::size_t kHeaderSize = 8;
inline constexpr std::size_t kRecordOverhead = kHeaderSize + 1;
inline constexpr std::size_t kMaxPayload = 0xFFFF;
inline constexpr std::size_t kMaxRecord = kMaxPayload + kRecordOverhead;

// The payload of an EVENT record that says why samples are missing; 0x09 says that they go on.
inline constexpr std::uint8_t kEventEnterIdleSleep = 0x08;

// A view of one record; the function that returns it says how long the bytes stay.
struct Record {
  std::uint8_t type = 0;
  std::uint32_t unix_time = 0;
  std::span<const std::uint8_t> payload;
  std::span<const std::uint8_t> raw;  // header, payload and checksum as they stand on disk
  bool checksum_ok = false;
  std::uint64_t offset = 0;  // of the separator in log.bin

  bool is(RecordType wanted) const { return type == static_cast<std::uint8_t>(wanted); }
};

// The checksum byte that belongs behind `header_and_payload`.
std::uint8_t record_checksum(std::span<const std::uint8_t> header_and_payload);

// Appends one record with its right checksum. The payload must not be longer than kMaxPayload; what
// is longer is a defect of the caller and is cut there.
void append_record(Bytes& out, RecordType type, std::uint32_t unix_time,
                   std::span<const std::uint8_t> payload);

}  // namespace sixpoint::gt3x
