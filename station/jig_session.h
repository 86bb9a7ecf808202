// A jig run on a real link: the unit, the jig and the state machine (jig_run.h) brought together.
//
// Sets the filter configuration and checks it, streams, lets the machine ask for poses, computes
// the constants from the six faces, judges them on readings that the fit has not seen, and, when
// asked, writes them into the unit, reads them back and measures two poses again with what the unit
// then holds. Stores nothing: the report carries all there is to store.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "base/env.h"
#include "calib/constants.h"
#include "calib/gravity.h"
#include "device/unit.h"
#include "station/jig_report.h"
#include "station/jig_run.h"
#include "station/limits.h"
#include "station/verdict.h"

namespace sixpoint::station {

struct JigSessionOptions {
  JigRunOptions run;
  calib::FilterConfiguration filter = calib::FilterConfiguration::current;
  calib::LocalGravity gravity = calib::gravity_unknown();  // where the jig stands
  Limits limits = default_limits();
  RetestState retest;  // what the unit's earlier runs demand (verdict.h)
  // Longest silence of a streaming unit before it is given up.
  double silence_s = 3;
  // An error in mid-run ends in a report with `ended_by`, so that what was measured can be kept;
  // without it, in the error alone.
  bool keep_interrupted = false;
  // How often a jig that turns by itself is asked how it is.
  double jig_poll_s = 0.25;
  // So many tilted placements in a row that the jig calls exact: it does not stand where it says.
  int jig_disagreements = 3;
};

// What a person is told while it runs.
using JigTeller = std::function<void(const JigAction&)>;

// A unit and what turns it; both belong to somebody who keeps them until the next reopen().
struct UnitOnJig {
  device::Unit* unit = nullptr;
  device::Jig* jig = nullptr;
};

// What an earlier program had of this run.
struct JigResume {
  JigProgress progress;
  UtcTime started{};
  std::optional<device::CalibrationPage> as_found;
  std::optional<device::CalibrationPage> written;  // what the run wrote into the unit, if it did
  std::string raw_csv;                             // with its headline
};

// Whoever drives the run hangs in here; all called on the run's own thread, all may be empty.
struct JigHooks {
  JigTeller tell;
  // After every block of samples: for traces and live pictures.
  std::function<void(const device::SampleBlock&, const JigRun&)> samples;
  // Rows as they are added to the raw data, the headline first: for a disk.
  std::function<void(std::string_view rows)> raw;
  // After every action: for a disk, so that the run can be resumed.
  std::function<void(const JigReport&, const JigRun&)> progress;
  // What the operator said since the last call; asked after every block.
  std::function<std::optional<OperatorWord>()> words;
  // The unit went away. Waits until it is back and answers with it, opened anew, or gives up.
  // Where this is empty, the run ends with the error; otherwise with a report that is inconclusive.
  std::function<Result<UnitOnJig>(const Error&)> reopen;
};

// usage where the wanted filter cannot help this unit; device_unavailable when the unit goes away;
// otherwise a report, whatever its verdict.
Result<JigReport> run_jig(device::Unit& unit, device::Jig& jig, Env& env,
                          const JigSessionOptions& options, const JigTeller& tell);
Result<JigReport> run_jig(UnitOnJig on_jig, Env& env, const JigSessionOptions& options,
                          const JigHooks& hooks, const std::optional<JigResume>& resume = {});

// The report of a run that ended with its program and whose unit did not come back: inconclusive,
// with all that was measured.
JigReport interrupted_report(const JigResume& resume, const std::string& serial,
                             const std::string& firmware, const JigSessionOptions& options,
                             UtcTime ended, const std::string& reason);

}  // namespace sixpoint::station
