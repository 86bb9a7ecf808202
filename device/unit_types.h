// What a unit answers and delivers, as plain data: no wire protocol, no transport.
//
//   const Identity& who = unit.identity();
//   const std::string line = who.model + " " + who.serial + ", firmware " + who.firmware;
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/measure.h"
#include "base/sha256.h"
#include "base/stored_constants.h"
#include "base/time.h"
#include "calib/constants.h"

namespace sixpoint::device {

using calib::FilterConfiguration;

// What a unit can be asked for.
struct UnitAbilities {
  bool streams = false;             // live samples, filter configuration
  bool holds_constants = false;     // a calibration page that can be read and written
  bool records_on_command = false;  // start_recording(), stop_recording()
  bool offers_recordings = false;   // recordings(), download()
};

// Who a device is, of a unit and of a jig.
struct DeviceNames {
  std::string serial;    // at most 16 characters, printable ASCII without blanks
  std::string firmware;  // at most 12, such as "1.5.0"
  std::string model;     // at most 12, such as "wGT3XBT"

  bool operator==(const DeviceNames&) const = default;
};

struct Identity : DeviceNames {
  std::uint8_t version = 1;
  std::uint8_t kind = 0;  // 0 = activity monitor
  std::uint16_t battery_mv = 0;
  std::uint16_t accel_scale_lsb_per_g = 256;
  std::uint16_t page_bytes = 512;

  bool operator==(const Identity&) const = default;
};

// The nine constants that a unit holds, and when they were measured.
struct CalibrationPage {
  StoredConstants constants;
  UtcTime calibrated{};  // whole seconds, years 2000 to 2255

  bool operator==(const CalibrationPage&) const = default;
};

struct FilterState {
  FilterConfiguration stream = FilterConfiguration::current;
  // What this unit's firmware chooses for recordings, by its calibration date.
  FilterConfiguration recording = FilterConfiguration::current;

  bool operator==(const FilterState&) const = default;
};

// One reading of the sensor, unscaled, in raw counts.
using RawCounts = PerAxis<std::int16_t>;

struct SampleBlock {
  std::uint16_t sequence = 0;  // of the report
  std::uint32_t first_index = 0;
  std::uint64_t device_time_us = 0;
  double temperature_c = 0;  // of the die, in steps of 0.01
  FilterConfiguration filter = FilterConfiguration::current;
  std::vector<RawCounts> counts;  // 1 to 6 in the project's protocol

  bool operator==(const SampleBlock&) const = default;
};

struct StreamStatistics {
  std::uint64_t samples = 0;
  std::uint64_t lost_samples = 0;       // by the sample index
  std::uint64_t duplicate_reports = 0;  // delivered once
  std::uint64_t damaged_reports = 0;    // CRC, header or content; of every kind
  std::uint64_t overflowed_blocks = 0;  // came while the program did not read
  std::uint64_t failed_transfers = 0;   // stalls and the like; repeated
  // Device time and sample index differ by more than a clock can drift.
  std::uint64_t clock_jumps = 0;
  double clock_jumped_s = 0;  // their sum
};

// Calls visit(name, member) for each of them: all that adds, writes or reads them goes through this
// list, so that a new one is forgotten nowhere.
template <class Visit>
void for_each_count(Visit&& visit) {
  using Of = StreamStatistics;
  visit("samples", &Of::samples);
  visit("lost_samples", &Of::lost_samples);
  visit("duplicate_reports", &Of::duplicate_reports);
  visit("damaged_reports", &Of::damaged_reports);
  visit("overflowed_blocks", &Of::overflowed_blocks);
  visit("failed_transfers", &Of::failed_transfers);
  visit("clock_jumps", &Of::clock_jumps);
  visit("clock_jumped_s", &Of::clock_jumped_s);
}

struct RecordingInfo {
  std::uint16_t id = 0;
  std::uint64_t bytes = 0;
  std::uint32_t start_unix_time = 0;
  Sha256Digest sha256{};

  bool operator==(const RecordingInfo&) const = default;
};

}  // namespace sixpoint::device
