// The inertial sensor of a GT9X Link (SENSOR_DATA) as the CSV that the vendor's software exports.
//
//   SIXPOINT_ASSIGN(auto recording, Recording::open(env.files, "unit.gt3x"));
//   std::string csv;
//   const TextSink sink = [&](std::string_view text) {
//     csv += text;
//     return Status{};
//   };
//   SIXPOINT_ASSIGN(const ImuCsvTally tally, write_imu_csv(recording, sink));
//
// Ten header lines, one line of column names, then 100 lines per second with a time stamp each. The
// sensor's clock is its own: a second of 99 or 101 samples is interpolated linearly at j * n / 100,
// its last sample standing for what would lie behind it, as the vendor does. Six decimals without
// trailing zeros. Tested line for line against an export of the vendor.
#pragma once

#include <cstdint>

#include "gt3x/recording.h"
#include "gt3x/rows/raw_csv.h"

namespace sixpoint::gt3x {

inline constexpr std::size_t kImuRate_hz = 100;

struct ImuCsvTally {
  std::uint64_t seconds = 0;
  std::uint64_t samples = 0;             // of the sensor, before interpolation
  std::uint64_t resampled_seconds = 0;   // those that did not hold 100 samples
  std::uint64_t unreadable_records = 0;  // wrong checksum, or not as their schema says
  std::uint64_t other_columns = 0;       // records of a schema with other columns than the first
};

// bad_data for a recording of the old form, and for one without a schema or without data.
Result<ImuCsvTally> write_imu_csv(Recording& recording, const TextSink& sink);

}  // namespace sixpoint::gt3x
