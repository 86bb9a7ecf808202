// A bundle: the folder that a station makes of a unit's run through a protocol.
//
//   SIXPOINT_ASSIGN(const BundleReport report, write_bundle(env.files, "bundle", scenario));
//
//     recording.gt3x   what the unit stored, ACTIVITY2 records, segments one after another
//     protocol.json    schema sixpoint/bundle/1: unit, rate, scale, gravity, segments
//     temperature.csv  host_time_s,temperature_c: the unit's own log, one a second, 0.1 C noise
//     host_clock.csv   sample_index,host_time_s: when each one-second packet began, +-2 ms
#pragma once

#include <cstdint>
#include <string>

#include "base/env.h"
#include "sim/scenario.h"

namespace sixpoint::sim {

struct BundleReport {
  std::uint64_t samples = 0;
  double duration_s = 0;  // of the recording
  std::uint64_t segments = 0;
};

// Runs scenario.protocol (usage where there is none) and writes the folder, which is made where it
// is missing. Files that are there are replaced, each whole or not at all; protocol.json comes
// last. The same scenario gives the same bytes.
Result<BundleReport> write_bundle(FileSystem& files, const std::string& folder,
                                  const Scenario& scenario);

}  // namespace sixpoint::sim
