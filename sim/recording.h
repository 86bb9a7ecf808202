// A .gt3x file as a unit of this truth would leave it.
//
//   SIXPOINT_ASSIGN(const RecordingReport report, write_recording(files, "unit.gt3x", scenario));
//   report.duration_s;
//
// PARAMETERS, METADATA and info.txt hold what real files of a wGT3X-BT hold.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "base/env.h"
#include "gt3x/forms/info.h"
#include "gt3x/log/samples.h"
#include "sim/scenario.h"

namespace sixpoint::sim {

// What stands in log.bin before the first sample: METADATA and PARAMETERS.
Bytes log_preamble(const UnitTruth& unit, UtcTime start, int rate_hz);

// One second of samples as an ACTIVITY (12 bits) or ACTIVITY2 record (16).
void append_second(Bytes& log, UtcTime time, std::span<const gt3x::Counts> samples, bool wide);

// What a unit calls itself, in info.txt ("Device Type") and on the wire, as real ones do: "wGT3XBT",
// or "Link" where gt3x::model_of() of its serial number is "GT9X Link".
std::string_view device_type_of(std::string_view serial);

// info.txt. `end` is the time after the last sample; `battery_mv` as the unit has it when the file is
// made.
inline constexpr int kFullBattery_mv = 4170;
gt3x::Info recording_info(const UnitTruth& unit, UtcTime start, UtcTime end, int rate_hz,
                          int battery_mv = kFullBattery_mv);

struct RecordingReport {
  std::uint64_t samples = 0;
  double duration_s = 0;
  std::uint64_t clipped_samples = 0;
};

// Gets the truth second by second: Unix time of the first sample, and the specific force in the
// case's axes in g, one vector per stored sample.
using TruthSink = std::function<Status(UtcTime time, std::span<const Eigen::Vector3d> true_g)>;

// Simulates the scenario, whole seconds only, and writes it. Memory grows with
// the length of free-living motion only: its bouts are kept, some hundreds of bytes a minute.
// cannot_create where `path` cannot be made; configuration where an effect does not fit in.
Result<RecordingReport> write_recording(FileSystem& files, const std::string& path,
                                        const Scenario& scenario, const TruthSink& truth = {});

}  // namespace sixpoint::sim
