// The uncertainty budget of a run: what its report holds that has limits, each value with its
// standard uncertainty (docs/verdicts.md has the budget in words).
//
//   Verdict verdict = judge_quantities(measured_quantities(report), report.limits);
//
// The report holds counts (LSB), g, mg and degrees as its own header says; every quantity has the
// unit that its name ends with. Sources: docs/verdicts.md; the datasheet of the ADXL362. A pure
// function; any thread.
#pragma once

#include <vector>

#include "station/limits/verdict.h"

namespace sixpoint::station {

struct JigReport;  // jig_report.h

// Empty where the report has no solution of six poses.
std::vector<Measured> measured_quantities(const JigReport& report);

}  // namespace sixpoint::station
