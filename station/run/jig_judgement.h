// From a run's readings to constants, and from those to the verdict on the unit.
//
//   SIXPOINT_ASSIGN(const bool may_write, judge_readings(report, run));
//   JigEnding ending;
//   ending.write = may_write;
//   conclude_report(report, run, ending);  // verdict, codes, reasons
//
// Uncertainties: six_pose.h and budget.h. The functions change the caller's report only; any
// thread.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "calib/poses/gravity.h"
#include "calib/poses/six_pose.h"
#include "station/limits/limits.h"
#include "station/limits/verdict.h"
#include "station/run/jig_report.h"
#include "station/run/jig_run.h"

namespace sixpoint::station {

// Constants from `faces`, judged by `held_out`. Ranges are left to the limits.
Result<calib::SixPoseReport> solve_faces(const std::vector<PoseReading>& faces,
                                         const std::vector<PoseReading>& held_out,
                                         const calib::LocalGravity& gravity, const Limits& limits);

// Solves, chooses the solution by the readings that no solution used, and fills the report's
// constants, residuals and uncertainty. True when the constants may be used; false also while faces
// are missing.
Result<bool> judge_readings(JigReport& report, const JigRun& run);

// What the machine does not know about the end of a run.
struct JigEnding {
  bool write = false;         // the constants were to be written
  RetestState retest;         // of the unit's earlier runs
  std::string last_text;      // text of the machine's last action
  std::optional<Error> gone;  // why the unit did not come back
};
// Verdict, codes, reasons and quantities of a report whose readings judge_readings() has seen.
void conclude_report(JigReport& report, const JigRun& run, const JigEnding& ending);

}  // namespace sixpoint::station
