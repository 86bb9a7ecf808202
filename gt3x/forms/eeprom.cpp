#include "gt3x/forms/eeprom.h"

#include <algorithm>
#include <chrono>

#include "gt3x/forms/parameters.h"

namespace sixpoint::gt3x {
namespace {

using Memory = std::span<const std::uint8_t>;

constexpr std::size_t kSerialSize = 16;
constexpr std::size_t kCalibration = 256;
constexpr std::size_t kConstants = kCalibration + 4;
constexpr std::size_t kDate = kConstants + 18;
constexpr std::size_t kFirmware = 349;
constexpr std::size_t kCrc = 510;
constexpr std::string_view kPattern = "TUNE";
constexpr std::size_t kDateSize = 6;

// Polynomial x^16 + x^12 + x^5 + 1, from all ones, most significant bit first.
std::uint16_t crc_ccitt(Memory bytes) {
  std::uint32_t crc = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    crc ^= static_cast<std::uint32_t>(byte) << 8U;
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc & 0x8000U) != 0 ? ((crc << 1U) ^ 0x1021U) & 0xFFFFU : (crc << 1U) & 0xFFFFU;
    }
  }
  return static_cast<std::uint16_t>(crc);
}

std::optional<UtcTime> date_at(Memory bytes, std::size_t at) {
  const std::chrono::year_month_day date(std::chrono::year(2000 + bytes[at]),
                                         std::chrono::month(bytes[at + 2]),
                                         std::chrono::day(bytes[at + 1]));
  constexpr int kLastYear = 99;
  if (bytes[at] > kLastYear || !date.ok() || bytes[at + 3] > 23 || bytes[at + 4] > 59 ||
      bytes[at + 5] > 59) {
    return std::nullopt;
  }
  return UtcTime(std::chrono::sys_days(date)) + std::chrono::hours(bytes[at + 3]) +
         std::chrono::minutes(bytes[at + 4]) + std::chrono::seconds(bytes[at + 5]);
}

tl::unexpected<Error> bad(const char* what) {
  return fail(ErrorCode::bad_data, what, "eeprom.bin",
              "take the constants from the unit, or from another recording of it");
}

}  // namespace

Result<UnitMemory> parse_eeprom(Memory bytes) {
  if (bytes.size() < kCrc + 2 ||
      !std::equal(kPattern.begin(), kPattern.end(), bytes.begin() + kCalibration)) {
    return bad("the image of the unit's memory holds no constants");
  }
  if (crc_ccitt(bytes.subspan(kCalibration, kCrc - kCalibration)) !=
      static_cast<std::uint16_t>(bytes[kCrc] << 8U | bytes[kCrc + 1])) {
    return bad("the constants in the image of the unit's memory are damaged (CRC)");
  }
  UnitMemory memory;
  for (std::size_t i = 0; i < kSerialSize && bytes[i] != 0 && bytes[i] != 0xFF; ++i) {
    memory.serial += static_cast<char>(bytes[i]);
  }
  std::size_t at = kConstants;
  for (PerAxis<int>* axes : {&memory.constants.zero_lsb, &memory.constants.positive_lsb,
                             &memory.constants.negative_lsb}) {
    for (int& value : *axes) {
      value = static_cast<std::int16_t>(bytes[at] | bytes[at + 1] << 8U);
      at += 2;
      if (value < kStoredConstantMin || value > kStoredConstantMax) {
        return bad("the image of the unit's memory holds constants that no unit has");
      }
    }
  }
  memory.calibration_time = date_at(bytes, kDate);
  std::uint32_t firmware = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    firmware |= static_cast<std::uint32_t>(bytes[kFirmware + i]) << (8U * i);
  }
  constexpr std::uint32_t kErased = 0xFFFFFFFF;
  memory.firmware = firmware == kErased ? "" : decode_firmware(firmware);
  return memory;
}

std::vector<OldBatteryReading> parse_old_battery(Memory bytes) {
  std::vector<OldBatteryReading> readings;
  for (; bytes.size() >= kOldBatteryEntry; bytes = bytes.subspan(kOldBatteryEntry)) {
    if (const auto time = date_at(bytes, 0)) {
      readings.push_back({*time, (bytes[kDateSize] | bytes[kDateSize + 1] << 8U) / 1000.0});
    }
  }
  return readings;
}

}  // namespace sixpoint::gt3x
