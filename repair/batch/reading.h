// What a recording says beside its samples, gathered in the pass that reads them.
//
//   SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(env.files, path));
//   SIXPOINT_ASSIGN(auto stream, gt3x::SampleStream::open(recording, {}));
//   SIXPOINT_ASSIGN(const gt3x::RowArray rows,
//                   gt3x::read_all_rows(stream, gt3x::RowValue::g_float64));
//   SIXPOINT_ASSIGN(const Inspection found, reading_of(recording, stream));
//   inspection_to_json(found, path)["gaps"];
#pragma once

#include <cstdint>

#include "gt3x/recording.h"
#include "gt3x/rows/sample_stream.h"
#include "repair/triage/inspection.h"

namespace sixpoint::repair {

// Bytes: half of the machine's memory, for RowArrayOptions::most_bytes. What is more than there is
// would not be refused by the system, but end the process.
std::uint64_t half_of_memory();

// As inspect() says it, but for what only a look at every sample tells: no still periods, no
// clipped samples. `stream` was read to its end. Without filling, the recording is read once more
// for its gaps and what is irregular; with salvage, for its losses.
Result<Inspection> reading_of(gt3x::Recording& recording, const gt3x::SampleStream& stream,
                              bool salvage = false);

}  // namespace sixpoint::repair
