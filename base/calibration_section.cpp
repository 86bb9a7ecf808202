#include "base/calibration_section.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <string_view>

#include "base/crc_ccitt.h"

namespace sixpoint {

namespace {

constexpr std::string_view kPattern = "TUNE";
constexpr std::size_t kSection = 256;
constexpr std::size_t kConstants = kSection + kPattern.size();
constexpr std::size_t kDate = 278;
constexpr std::size_t kCrc = 510;
constexpr int kFirstYear = 2000;
constexpr std::uint8_t kErased = 0xFF;

// The order of the nine constants in the memory.
constexpr std::array kOrder = {&StoredConstants::zero_lsb, &StoredConstants::positive_lsb,
                               &StoredConstants::negative_lsb};

std::uint16_t crc_of(std::span<const std::uint8_t> memory) {
  return crc_ccitt(memory.subspan(kSection, kCrc - kSection));
}

void write_memory_date(UtcTime time, std::span<std::uint8_t> bytes) {
  const auto day = std::chrono::floor<std::chrono::days>(time);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss clock(std::chrono::floor<std::chrono::seconds>(time - day));
  bytes[0] = static_cast<std::uint8_t>(static_cast<unsigned>(date.month()));
  bytes[1] = static_cast<std::uint8_t>(static_cast<unsigned>(date.day()));
  bytes[2] = static_cast<std::uint8_t>(static_cast<int>(date.year()) - kFirstYear);
  bytes[3] = static_cast<std::uint8_t>(clock.hours().count());
  bytes[4] = static_cast<std::uint8_t>(clock.minutes().count());
  bytes[5] = static_cast<std::uint8_t>(clock.seconds().count());
}

}  // namespace

std::optional<UtcTime> read_memory_date(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < kMemoryDate) {
    return std::nullopt;
  }
  const std::chrono::year_month_day date(std::chrono::year(kFirstYear + bytes[2]),
                                         std::chrono::month(bytes[0]), std::chrono::day(bytes[1]));
  if (!date.ok() || bytes[3] > 23 || bytes[4] > 59 || bytes[5] > 59) {
    return std::nullopt;
  }
  return UtcTime(std::chrono::sys_days(date)) + std::chrono::hours(bytes[3]) +
         std::chrono::minutes(bytes[4]) + std::chrono::seconds(bytes[5]);
}

Result<CalibrationSection> read_calibration_section(std::span<const std::uint8_t> memory) {
  if (memory.size() < kMemoryWithCalibration ||
      !std::equal(kPattern.begin(), kPattern.end(), memory.begin() + kSection)) {
    return fail(ErrorCode::bad_data, "the unit's memory holds no calibration");
  }
  if (crc_of(memory) != static_cast<std::uint16_t>(memory[kCrc] << 8U | memory[kCrc + 1])) {
    return fail(ErrorCode::bad_data, "the calibration in the unit's memory is damaged (CRC)");
  }
  CalibrationSection section;
  std::size_t at = kConstants;
  for (const auto member : kOrder) {
    for (int& lsb : section.constants.*member) {
      lsb = static_cast<std::int16_t>(memory[at] | memory[at + 1] << 8U);
      at += 2;
      if (lsb < kStoredConstantMin || lsb > kStoredConstantMax) {
        return fail(ErrorCode::bad_data, "the unit's memory holds constants that no unit has");
      }
    }
  }
  section.calibrated = read_memory_date(memory.subspan(kDate));
  return section;
}

void write_calibration_section(const CalibrationSection& section, std::span<std::uint8_t> memory) {
  std::copy(kPattern.begin(), kPattern.end(), memory.begin() + kSection);
  std::size_t at = kConstants;
  for (const auto member : kOrder) {
    for (const int lsb : section.constants.*member) {
      const auto bits = static_cast<std::uint16_t>(lsb);
      memory[at++] = static_cast<std::uint8_t>(bits & 0xFFU);
      memory[at++] = static_cast<std::uint8_t>(bits >> 8U);
    }
  }
  const auto date = memory.subspan(kDate, kMemoryDate);
  std::ranges::fill(date, kErased);
  if (section.calibrated) {
    write_memory_date(*section.calibrated, date);
  }
  const std::uint16_t crc = crc_of(memory);
  memory[kCrc] = static_cast<std::uint8_t>(crc >> 8U);
  memory[kCrc + 1] = static_cast<std::uint8_t>(crc & 0xFFU);
}

}  // namespace sixpoint
