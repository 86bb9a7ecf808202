#include "gt3x/log/record.h"

#include <algorithm>
#include <array>
#include <cstring>

#include <fmt/format.h>

namespace sixpoint::gt3x {

std::string record_type_name(std::uint8_t type) {
  constexpr std::array<std::string_view, 31> kNames = {"ACTIVITY",
                                                       "ANT_PLUS",
                                                       "BATTERY",
                                                       "EVENT",
                                                       "HEART_RATE_BPM",
                                                       "LUX",
                                                       "METADATA",
                                                       "TAG",
                                                       "TEMPERATURE_OLD",
                                                       "EPOCH",
                                                       "DAILY_SUMMARY",
                                                       "HEART_RATE_ANT",
                                                       "EPOCH2",
                                                       "CAPSENSE",
                                                       "HEART_RATE_BLE",
                                                       "EPOCH3",
                                                       "EPOCH4",
                                                       "IMU_9DOF",
                                                       "MAGNETOMETER",
                                                       "FIFO_ERROR",
                                                       "FIFO_DUMP",
                                                       "PARAMETERS",
                                                       "IMU_ACCELEROMETER",
                                                       "DEBUG",
                                                       "SENSOR_SCHEMA",
                                                       "SENSOR_DATA",
                                                       "ACTIVITY2",
                                                       "ACTIVITY3",
                                                       "",
                                                       "",
                                                       "TEMPERATURE"};
  return type < kNames.size() && !kNames[type].empty() ? std::string(kNames[type])
                                                       : fmt::format("TYPE_{}", type);
}

std::uint8_t record_checksum(std::span<const std::uint8_t> header_and_payload) {
  // Four words at a time: this runs over every byte of every recording.
  std::array<std::uint64_t, 4> words{};
  std::size_t i = 0;
  for (; i + sizeof words <= header_and_payload.size(); i += sizeof words) {
    std::array<std::uint64_t, 4> here{};
    std::memcpy(here.data(), header_and_payload.data() + i, sizeof here);
    for (std::size_t lane = 0; lane < words.size(); ++lane) {
      words[lane] ^= here[lane];
    }
  }
  std::uint64_t folded = words[0] ^ words[1] ^ words[2] ^ words[3];
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
