#include "gt3x/log/record.h"

#include <algorithm>
#include <cstring>

#include <fmt/format.h>

namespace sixpoint::gt3x {

std::string record_type_name(std::uint8_t type) {
  switch (static_cast<RecordType>(type)) {
    case RecordType::activity:
      return "ACTIVITY";
    case RecordType::battery:
      return "BATTERY";
    case RecordType::event:
      return "EVENT";
    case RecordType::heart_rate_bpm:
      return "HEART_RATE_BPM";
    case RecordType::lux:
      return "LUX";
    case RecordType::metadata:
      return "METADATA";
    case RecordType::tag:
      return "TAG";
    case RecordType::epoch:
      return "EPOCH";
    case RecordType::heart_rate_ant:
      return "HEART_RATE_ANT";
    case RecordType::epoch2:
      return "EPOCH2";
    case RecordType::capsense:
      return "CAPSENSE";
    case RecordType::heart_rate_ble:
      return "HEART_RATE_BLE";
    case RecordType::epoch3:
      return "EPOCH3";
    case RecordType::epoch4:
      return "EPOCH4";
    case RecordType::parameters:
      return "PARAMETERS";
    case RecordType::sensor_schema:
      return "SENSOR_SCHEMA";
    case RecordType::sensor_data:
      return "SENSOR_DATA";
    case RecordType::activity2:
      return "ACTIVITY2";
    case RecordType::activity3:
      return "ACTIVITY3";
    case RecordType::temperature:
      return "TEMPERATURE";
  }
  return fmt::format("TYPE_{}", type);
}

std::uint8_t record_checksum(std::span<const std::uint8_t> header_and_payload) {
  // Eight bytes at a time: this runs over every byte of every recording.
  std::uint64_t folded = 0;
  std::size_t i = 0;
  for (; i + sizeof folded <= header_and_payload.size(); i += sizeof folded) {
    std::uint64_t word = 0;
    std::memcpy(&word, header_and_payload.data() + i, sizeof word);
    folded ^= word;
  }
  folded ^= folded >> 32;
  folded ^= folded >> 16;
  folded ^= folded >> 8;
  auto sum = static_cast<std::uint8_t>(folded & 0xFF);
  for (; i < header_and_payload.size(); ++i) {
    sum = static_cast<std::uint8_t>(sum ^ header_and_payload[i]);
  }
  return static_cast<std::uint8_t>(~sum);
}

void append_record(Bytes& out, RecordType type, std::uint32_t unix_time,
                   std::span<const std::uint8_t> payload) {
  const std::size_t size = std::min(payload.size(), kMaxPayload);
  const std::size_t start = out.size();
  out.push_back(kSeparator);
  out.push_back(static_cast<std::uint8_t>(type));
  for (int shift = 0; shift < 32; shift += 8) {
    out.push_back(static_cast<std::uint8_t>(unix_time >> shift));
  }
  out.push_back(static_cast<std::uint8_t>(size));
  out.push_back(static_cast<std::uint8_t>(size >> 8));
  out.insert(out.end(), payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(size));
  out.push_back(record_checksum(std::span(out).subspan(start)));
}

}  // namespace sixpoint::gt3x
