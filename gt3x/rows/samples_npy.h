// A recording's samples as a NumPy array in a file (.npy, format 1.0).
//
//   SIXPOINT_ASSIGN(auto recording, Recording::open(env.files, "unit.gt3x"));
//   std::string bytes;
//   const TextSink sink = [&](std::string_view piece) {
//     bytes += piece;
//     return Status{};
//   };
//   SIXPOINT_ASSIGN(const RawCsvTally tally, write_samples_npy(recording, {}, sink));
//
// The array has a row per line of the CSV (raw_csv.h) and three columns, X Y Z, row after row:
//
//     raw_lsb  type            values
//     false    float32, '<f4'  g: the count over the scale, not rounded to 0.001
//     true     int16, '<i2'    stored counts
//
// It has no times: row n belongs to start + n / rate, where nothing is left out.
#pragma once

#include "gt3x/recording.h"
#include "gt3x/rows/raw_csv.h"

namespace sixpoint::gt3x {

// The header holds the number of rows, so the recording is read twice. `options`: time and
// created_by are not used. Errors as write_raw_csv().
Result<RawCsvTally> write_samples_npy(Recording& recording, const RawCsvOptions& options,
                                      const TextSink& sink);

}  // namespace sixpoint::gt3x
