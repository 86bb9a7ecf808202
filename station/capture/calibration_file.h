// Can a calibration recording help to repair affected files? Asked of a file that was recorded
// without the program and downloaded, and of a unit before it records.
//
//   SIXPOINT_ASSIGN(const CalibrationFileCheck check, check_calibration_file(env, "side.gt3x"));
//   if (check.usable()) {
//     const auto& constants = check.solved->calibration;
//   } else {
//     check.refusal;  // why; or what is missing: check.solved->verification.missing_directions
//   }
//
// Free functions; any thread. The Env belongs to the caller.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "calib/solve.h"

namespace sixpoint::station {

struct CalibrationFileCheck {
  std::string serial;
  std::string firmware;
  std::vector<std::string> refusal;  // of why_recording_cannot_help(); then nothing was solved
  std::optional<calib::SolveReport> solved;
  std::string sha256;

  bool usable() const { return refusal.empty() && solved && solved->usable(); }
};

// A recording that may not lend its constants (repair/rescale/gate.h) is refused as well, and not
// solved. no_input, bad_data for what is no recording or was repaired already.
Result<CalibrationFileCheck> check_calibration_file(Env& env, const std::string& path,
                                                    const calib::SolveOptions& options = {});

// A recording of a unit, or the one that it is about to make.
struct RecordingOrigin {
  std::string serial;
  std::string firmware;
  std::optional<calib::FilterConfiguration> filter;  // in force while it records; empty: unknown
  bool unit_is_here = false;  // plugged in: it can be set up, recorded and measured again
};

// Why constants of this recording cannot repair affected files, and what to do; empty when they
// can.
//
// | unit is here | serial number | filter  | can help                                         |
// | yes          | any           | unknown | yes: the solver checks the file                  |
// | no           | not MOS...    | any     | no: its files were never affected                |
// | no           | MOS...        | unknown | no: the constants belong to an unknown filter    |
// | yes, no      | others        | legacy  | no: affected files were recorded under `current` |
// | yes, no      | others        | current | yes                                              |
//
// `legacy` is in force on a unit calibrated before 2014-03-24 with firmware below 1.4.0 or
// from 1.8.0.
std::vector<std::string> why_recording_cannot_help(const RecordingOrigin& origin);

}  // namespace sixpoint::station
