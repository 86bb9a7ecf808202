#include "gt3x/forms/small_records.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "gt3x/forms/model.h"
#include "gt3x/log/record.h"

namespace sixpoint::gt3x {
namespace {

using Row = std::vector<std::string>;
using Rows = std::vector<Row>;
using Payload = std::span<const std::uint8_t>;

constexpr int kNoReading = 0xFFFF;  // of light
constexpr std::size_t kBeaconSize = 15;
constexpr std::size_t kSerialSize = 13;
constexpr std::size_t kBeatSize = 5;
constexpr double kBeatClock_hz = 1024;

int two_bytes(Payload bytes, std::size_t at) { return bytes[at] | (bytes[at + 1] << 8); }

std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    out += c == '"' ? "\"\"" : std::string(1, c);
  }
  return out + "\"";
}

std::string text_in(Payload bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Row temperature_row(const TemperatureReading& reading,
                    const std::optional<TemperatureCalibration>& calibration) {
  const auto adc = [](std::optional<int> value) {
    return value ? std::to_string(*value) : std::string();
  };
  Row row = {adc(reading.processor_adc), adc(reading.accelerometer_adc), "", ""};
  if (calibration && reading.processor_adc) {
    row[2] = fmt::format("{}", calibration->processor_c(*reading.processor_adc));
  }
  if (calibration && reading.accelerometer_adc) {
    row[3] = fmt::format("{}", calibration->accelerometer_c(*reading.accelerometer_adc));
  }
  return row;
}

Rows beacons(Payload payload) {
  Rows rows;
  for (; !payload.empty(); payload = payload.subspan(kBeaconSize)) {
    rows.push_back({quoted(printable(text_in(payload.first(kSerialSize)), kSerialSize)),
                    std::to_string(static_cast<std::int8_t>(payload[kSerialSize])),
                    std::to_string(static_cast<std::int8_t>(payload[kSerialSize + 1]))});
  }
  return rows;
}

Rows beats(Payload payload) {
  Rows rows;
  for (; !payload.empty(); payload = payload.subspan(kBeatSize)) {
    rows.push_back({std::to_string(payload[0]),
                    fmt::format("{}", two_bytes(payload, 1) / kBeatClock_hz),
                    fmt::format("{}", two_bytes(payload, 3) / kBeatClock_hz)});
  }
  return rows;
}

}  // namespace

Result<std::uint8_t> parse_record_type(std::string_view name) {
  unsigned number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error == std::errc() && end == name.data() + name.size() && number <= 0xFF) {
    return static_cast<std::uint8_t>(number);
  }
  std::string known;
  for (unsigned type = 0; type <= 0xFF; ++type) {
    const std::string is_called = record_type_name(static_cast<std::uint8_t>(type));
    if (is_called == name) {
      return static_cast<std::uint8_t>(type);
    }
    known += is_called.starts_with("TYPE_") ? "" : " " + is_called;
  }
  return fail(ErrorCode::usage, fmt::format("no type of record '{}'", printable(name, 40)), {},
              "a number, or one of:" + known);
}

std::vector<std::string> small_record_columns(std::uint8_t type) {
  switch (static_cast<RecordType>(type)) {
    case RecordType::battery:
      return {"battery_v"};
    case RecordType::event:
      return {"code", "payload"};
    case RecordType::heart_rate_bpm:
      return {"heart_rate_bpm"};
    case RecordType::lux:
      return {"lux"};
    case RecordType::metadata:
      return {"text"};
    case RecordType::tag:
      return {"beacon", "transmit_power_db", "received_db"};
    case RecordType::heart_rate_ant:
      return {"beat", "previous_s", "current_s"};
    case RecordType::capsense:
      return {"signal", "reference", "worn", "bursts"};
    case RecordType::temperature:
      return {"processor_adc", "accelerometer_adc", "processor_c", "accelerometer_c"};
    default:
      return {"payload"};
  }
}

Result<std::vector<std::vector<std::string>>> small_record_rows(
    std::uint8_t type, std::span<const std::uint8_t> payload,
    const std::optional<TemperatureCalibration>& temperature) {
  const auto is_long = [&](bool right) -> Status {
    return right ? Status()
                 : Status(fail(ErrorCode::bad_data,
                               fmt::format("a {} record of {} bytes", record_type_name(type),
                                           payload.size()),
                               {}, "download the recording from the unit again"));
  };
  switch (static_cast<RecordType>(type)) {
    case RecordType::battery: {
      SIXPOINT_CHECK(is_long(payload.size() == 2));
      constexpr double kMvPerV = 1000;
      return Rows{{fmt::format("{}", two_bytes(payload, 0) / kMvPerV)}};
    }
    case RecordType::event:
      SIXPOINT_CHECK(is_long(!payload.empty()));
      return Rows{{std::to_string(payload[0]), to_hex(payload)}};
    case RecordType::heart_rate_bpm:
      SIXPOINT_CHECK(is_long(payload.size() == 1));
      return Rows{{std::to_string(payload[0])}};
    case RecordType::lux: {
      SIXPOINT_CHECK(is_long(payload.size() == 2));
      const int lux = two_bytes(payload, 0);
      return Rows{{lux == kNoReading ? std::string() : std::to_string(lux)}};
    }
    case RecordType::metadata:
      return Rows{{quoted(printable(text_in(payload), kMaxPayload))}};
    case RecordType::tag:
      SIXPOINT_CHECK(is_long(payload.size() % kBeaconSize == 0));
      return beacons(payload);
    case RecordType::heart_rate_ant:
      SIXPOINT_CHECK(is_long(payload.size() % kBeatSize == 0));
      return beats(payload);
    case RecordType::capsense:
      SIXPOINT_CHECK(is_long(payload.size() == 6));
      return Rows{{std::to_string(two_bytes(payload, 0)), std::to_string(two_bytes(payload, 2)),
                   std::to_string(payload[4]), std::to_string(payload[5])}};
    case RecordType::temperature: {
      SIXPOINT_ASSIGN(const TemperatureReading reading, parse_temperature(payload));
      return Rows{temperature_row(reading, temperature)};
    }
    default:
      return Rows{{to_hex(payload)}};
  }
}

std::optional<double> old_lux(std::string_view serial, int reading) {
  constexpr int kDark = 20;
  const std::string_view model = model_of(serial);
  const bool dark = reading < kDark || reading == kNoReading;
  if (model == "GT3X+") {
    return dark ? 0 : std::min(1.25 * reading, 2500.0);
  }
  if (model == "ActiSleep+") {
    return dark ? 0 : std::min(3.25 * reading, 6000.0);
  }
  return std::nullopt;
}

}  // namespace sixpoint::gt3x
