#include "gt3x/forms/sensor_schema.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "gt3x/forms/parameters.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::size_t kSchemaHeader = 6;
constexpr std::size_t kColumnSize = 23;
constexpr std::size_t kMostColumns = 64;
constexpr std::size_t kDataHeader = 2;
constexpr double kZeroOfTemperature_c = 21;

std::uint16_t two_bytes(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint16_t>(bytes[0] | (bytes[1] << 8));
}

tl::unexpected<Error> bad_record(std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), {},
              "download the recording from the unit again");
}

Result<SensorColumn> parse_column(std::span<const std::uint8_t> bytes) {
  SensorColumn column;
  column.big_endian = (bytes[0] & 1U) != 0;
  column.is_signed = (bytes[0] & 2U) != 0;
  const unsigned first_bit = bytes[1];
  const unsigned bits = bytes[2];
  if (first_bit % 8 != 0 || (bits != 8 && bits != 16 && bits != 32)) {
    return bad_record(fmt::format("a sensor's column of {} bits at bit {}", bits, first_bit));
  }
  column.first_byte = first_bit / 8;
  column.bytes = bits / 8;
  const std::uint32_t code = bytes[3] | (std::uint32_t{bytes[4]} << 8) |
                             (std::uint32_t{bytes[5]} << 16) | (std::uint32_t{bytes[6]} << 24);
  // To six decimals, as the vendor's software has it: its CSV shows the difference.
  constexpr double kDecimals = 1e6;
  column.scale = std::round(decode_float(code) * kDecimals) / kDecimals;
  column.label.assign(bytes.begin() + 7, bytes.end());
  const auto last = column.label.find_last_not_of(std::string_view(" \0", 2));
  column.label.resize(last == std::string::npos ? 0 : last + 1);
  return column;
}

bool is_temperature(std::string_view label) {
  constexpr std::string_view kLabel = "temperature";
  return std::ranges::equal(
      label, kLabel, [](char c, char small) { return c == small || c == small - 'a' + 'A'; });
}

double value_of(const SensorColumn& column, std::span<const std::uint8_t> sample) {
  std::uint32_t stored = 0;
  for (std::size_t i = 0; i < column.bytes; ++i) {
    const std::size_t at = column.big_endian ? i : column.bytes - 1 - i;
    stored = (stored << 8) | sample[column.first_byte + at];
  }
  auto whole = static_cast<std::int64_t>(stored);
  if (const std::int64_t range = std::int64_t{1} << (8 * column.bytes);
      column.is_signed && whole >= range / 2) {
    whole -= range;
  }
  auto value = static_cast<double>(whole);
  if (column.scale != 0) {
    value /= column.scale;
  }
  return is_temperature(column.label) ? value + kZeroOfTemperature_c : value;
}

}  // namespace

std::vector<std::string> SensorSchema::labels() const {
  std::vector<std::string> labels;
  for (const SensorColumn& column : columns) {
    if (!column.label.empty()) {
      labels.push_back(column.label);
    }
  }
  return labels;
}

Result<SensorSchema> parse_sensor_schema(std::span<const std::uint8_t> payload) {
  if (payload.size() < kSchemaHeader) {
    return bad_record("a SENSOR_SCHEMA record is cut short");
  }
  SensorSchema schema;
  schema.id = two_bytes(payload);
  const std::size_t columns = two_bytes(payload.subspan(2));
  if (columns == 0 || columns > kMostColumns ||
      payload.size() != kSchemaHeader + columns * kColumnSize) {
    return bad_record(
        fmt::format("a SENSOR_SCHEMA record of {} bytes for {} columns", payload.size(), columns));
  }
  for (std::size_t i = 0; i < columns; ++i) {
    SIXPOINT_ASSIGN(SensorColumn column,
                    parse_column(payload.subspan(kSchemaHeader + i * kColumnSize, kColumnSize)));
    schema.sample_bytes = std::max(schema.sample_bytes, column.first_byte + column.bytes);
    schema.columns.push_back(std::move(column));
  }
  return schema;
}

Result<std::uint16_t> schema_of_sensor_data(std::span<const std::uint8_t> payload) {
  if (payload.size() < kDataHeader) {
    return bad_record("a SENSOR_DATA record is cut short");
  }
  return two_bytes(payload);
}

Result<std::vector<std::vector<double>>> parse_sensor_data(const SensorSchema& schema,
                                                           std::span<const std::uint8_t> payload) {
  SIXPOINT_ASSIGN(const std::uint16_t id, schema_of_sensor_data(payload));
  if (id != schema.id) {
    return bad_record("a SENSOR_DATA record of another schema");
  }
  const auto bytes = payload.subspan(kDataHeader);
  if (bytes.size() % schema.sample_bytes != 0) {
    return bad_record(fmt::format("a SENSOR_DATA record of {} bytes for samples of {}",
                                  bytes.size(), schema.sample_bytes));
  }
  std::vector<std::vector<double>> samples;
  for (std::size_t at = 0; at < bytes.size(); at += schema.sample_bytes) {
    std::vector<double>& values = samples.emplace_back();
    for (const SensorColumn& column : schema.columns) {
      if (!column.label.empty()) {
        values.push_back(value_of(column, bytes.subspan(at, schema.sample_bytes)));
      }
    }
  }
  return samples;
}

}  // namespace sixpoint::gt3x
