// From a run's readings to constants, and from those to the verdict on the unit.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "calib/gravity.h"
#include "calib/six_pose.h"
#include "station/jig_report.h"
#include "station/jig_run.h"
#include "station/limits.h"
#include "station/verdict.h"

namespace sixpoint::station {

// Constants from `faces`, judged by `held_out`. Ranges are left to the limits.
Result<calib::SixPoseReport> solve_faces(const std::vector<PoseReading>& faces,
                                         const std::vector<PoseReading>& held_out,
                                         const calib::LocalGravity& gravity, const Limits& limits);

// Solves, chooses by the readings that no solution has seen, fills the report's constants,
// residuals and uncertainty, and says whether they may be used: false before all faces are there.
Result<bool> judge_readings(JigReport& report, const JigRun& run);

// How a run ended, beside what the machine knows.
struct JigEnding {
  bool write = false;         // the constants were to be written
  RetestState retest;         // what the unit's earlier runs demand
  std::string last_words;     // of the machine
  std::optional<Error> gone;  // why the unit was given up
};
// Verdict, codes, reasons and quantities of a report whose readings judge_readings() has seen.
void conclude_report(JigReport& report, const JigRun& run, const JigEnding& ending);

}  // namespace sixpoint::station
