// The records of one type as a CSV: a time and what the record says.
//
//   SIXPOINT_ASSIGN(auto recording, Recording::open(env.files, "unit.gt3x"));
//   std::string csv;
//   const TextSink sink = [&](std::string_view text) {
//     csv += text;
//     return Status{};
//   };
//   SIXPOINT_ASSIGN(const auto tally, write_records_csv(recording, 2, sink));  // BATTERY
//
// The first line names the columns: time (ISO 8601, by the recording's own clock, with a Z where that
// is UTC), unix_s, and
// those of gt3x/forms/small_records.h. Records come in the order of the file. Of the old form (no
// records) LUX is read from lux.bin, one value a second from the start on, and BATTERY from
// battery.bin. Readings of lux.bin are lux by old_lux(); where that is not known, they stand as they
// are under `lux_raw`.
#pragma once

#include <cstdint>

#include "gt3x/recording.h"
#include "gt3x/rows/raw_csv.h"

namespace sixpoint::gt3x {

struct RecordsCsvTally {
  std::uint64_t records = 0;
  std::uint64_t unreadable_records = 0;  // wrong checksum, or another length than the type's
};

// bad_data for a type other than LUX and BATTERY of the old form. A recording without such records
// gives the first line alone.
Result<RecordsCsvTally> write_records_csv(Recording& recording, std::uint8_t type,
                                          const TextSink& sink);

}  // namespace sixpoint::gt3x
