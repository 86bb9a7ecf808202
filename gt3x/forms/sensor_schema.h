// The inertial sensor of a GT9X Link: SENSOR_SCHEMA says how the samples of SENSOR_DATA lie.
//
//   Bytes schema_payload, data_payload;  // of the two records
//   SIXPOINT_ASSIGN(const SensorSchema schema, parse_sensor_schema(schema_payload));
//   SIXPOINT_ASSIGN(const auto samples, parse_sensor_data(schema, data_payload));
//   const double first = samples[0][0];  // the first column of the first sample, in its unit
//
// Layout (the vendor's public description, confirmed on a real recording and its CSV), all numbers
// little-endian: the schema's number (2 bytes), columns (2), samples of a record or 0 (2); then 23
// bytes per column: flags (bit 0: big-endian, bit 1: signed), first bit in the sample (1), bits
// (1), scale (4, as in PARAMETERS), label (16, ASCII with spaces). SENSOR_DATA: the schema's number
// (2), then the samples.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "base/result.h"

namespace sixpoint::gt3x {

struct SensorColumn {
  std::string label;  // "Gyroscope X"; empty for a column that only fills up
  bool big_endian = false;
  bool is_signed = false;
  std::size_t first_byte = 0;  // in the sample
  std::size_t bytes = 0;       // 1, 2 or 4
  // value = stored / scale, or as stored where it is 0. A column "Temperature", in capitals or small
  // letters, is 21 C more, as the sensor's datasheet has it (InvenSense MPU-9250, register map,
  // TEMP_OUT).
  double scale = 0;
};

struct SensorSchema {
  std::uint16_t id = 0;
  std::vector<SensorColumn> columns;  // all, also those without a label
  std::size_t sample_bytes = 0;

  std::vector<std::string> labels() const;  // of the columns that have one
};

// bad_data for a payload of another length than its columns need, for more than 64 of them, and for
// a column that is no whole number of bytes.
Result<SensorSchema> parse_sensor_schema(std::span<const std::uint8_t> payload);

// The number of the schema that a SENSOR_DATA record's payload names; bad_data where it is cut short.
Result<std::uint16_t> schema_of_sensor_data(std::span<const std::uint8_t> payload);

// One vector per sample, its values in the order of labels(). bad_data for another schema's number
// and for a payload that is no whole number of samples.
Result<std::vector<std::vector<double>>> parse_sensor_data(const SensorSchema& schema,
                                                           std::span<const std::uint8_t> payload);

}  // namespace sixpoint::gt3x
