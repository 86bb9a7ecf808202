#include "gt3x/forms/eeprom.h"

#include <utility>

#include "base/calibration_section.h"
#include "gt3x/forms/parameters.h"

namespace sixpoint::gt3x {
namespace {

using Memory = std::span<const std::uint8_t>;

constexpr std::size_t kPageSerialSize = 16;
constexpr std::size_t kFirmware = 349;

tl::unexpected<Error> bad_page(std::string what) {
  return fail(ErrorCode::bad_data, std::move(what), "eeprom.bin",
              "take the constants from the unit, or from another recording of it");
}

}  // namespace

Result<UnitMemory> parse_eeprom(Memory bytes) {
  const auto section = read_calibration_section(bytes);
  if (!section) {
    return bad_page(section.error().what);
  }
  UnitMemory memory;
  for (std::size_t i = 0; i < kPageSerialSize && bytes[i] != 0 && bytes[i] != 0xFF; ++i) {
    memory.serial += static_cast<char>(bytes[i]);
  }
  memory.constants = section->constants;
  memory.calibration_time = section->calibrated;
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
    if (const auto time = read_memory_date(bytes)) {
      readings.push_back({*time, (bytes[kMemoryDate] | bytes[kMemoryDate + 1] << 8U) / 1000.0});
    }
  }
  return readings;
}

}  // namespace sixpoint::gt3x
