// A jig run on a real link: the unit, the jig and the state machine (jig_run.h) together.
//
//   JigSessionOptions options;
//   options.gravity = *calib::gravity_at(52.1, 40);
//   JigHooks hooks;
//   hooks.on_action = [](const JigAction& action) { std::cout << action.text << '\n'; };
//   SIXPOINT_ASSIGN(const JigReport report, run_jig({unit, jig}, env, options, hooks));
//
// Sets and checks the filter configuration, streams, asks for the poses, computes the constants
// from six faces and judges them on readings that the fit did not use. On request it writes them
// into the unit, reads them back and measures two poses again with the constants of the unit.
//
// A motorised jig is looked at before and after every placement, four times a second, and while
// the unit is away; a stop or a fault ends the run. The operator's stop stops the motor before all
// else. The run never releases a jig (device/jig.h): the operator does, before the next one.
//
// Stores nothing: the report has all there is to store. Blocking; one thread a run.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "calib/constants.h"
#include "calib/poses/gravity.h"
#include "device/unit.h"
#include "station/limits/limits.h"
#include "station/limits/verdict.h"
#include "station/run/jig_report.h"
#include "station/run/jig_run.h"
#include "station/run/jig_watch.h"

namespace sixpoint::station {

struct JigSessionOptions {
  JigRunOptions run;
  calib::FilterConfiguration filter = calib::FilterConfiguration::current;
  calib::LocalGravity gravity = calib::gravity_unknown();  // where the jig stands
  Limits limits = default_limits();
  RetestState retest;  // of the unit's earlier runs (verdict.h)
  std::vector<std::string>
      notes;             // reasons that the report begins with, such as a signed exception
  double silence_s = 3;  // of a streaming unit, then it counts as unplugged
  // An error in mid-run gives a report with `ended_by`, so that the readings can be stored. Without
  // it, run_jig() returns the error alone.
  bool keep_interrupted = false;
  JigWatchOptions jig_watch;
};

// Both belong to the caller and live until the next reopen().
struct UnitOnJig {
  device::Unit* unit = nullptr;
  device::Jig* jig = nullptr;
};

// What an earlier program left of this run.
struct JigResume {
  JigProgress progress;
  UtcTime started{};
  std::optional<device::CalibrationPage> as_found;
  std::optional<device::CalibrationPage> written;  // what the run wrote into the unit, if it did
  // A write was begun, and what the unit held after it was not read.
  bool write_begun = false;
  device::StreamStatistics stream = {};  // of the run until then
  std::string raw_csv;                   // with its headline
};

// Calls of a run to its driver, on the run's own thread; all may be empty.
struct JigHooks {
  std::function<void(const JigAction&)> on_action;  // every action, for the person
  // After every block of samples: for live pictures.
  std::function<void(const device::SampleBlock&, const JigRun&)> samples;
  // Rows of the raw data as they come, the headline first: for a disk.
  std::function<void(std::string_view rows)> raw;
  // After every action: for a disk, so that the run can be resumed.
  std::function<void(const JigReport&, const JigRun&)> progress;
  // Before the first byte of a write into the unit: for a disk, so that a later program knows of
  // the write. Where it fails nothing is written.
  std::function<Status(const JigReport&, const JigRun&)> write_begins;
  // The operator's next command since the last call; asked after every block.
  std::function<std::optional<OperatorCommand>()> next_command;
  // The unit was unplugged. Waits until it is back and returns it, opened anew, or an error.
  // Where this is empty, the run ends with the error; otherwise with an inconclusive report.
  // `look`: to be called several times a second while it waits, with the jig still open: the
  // operator may stop the run, and the jig may stop or fail. Where it fails, the wait ends with
  // its error.
  using Look = std::function<Status()>;
  std::function<Result<UnitOnJig>(const Error&, const Look& look)> reopen;
};

// The code (verdict.h) of a run that ended on an error: `unit_gone` only where the unit went away.
std::string interruption(ErrorCode code);

// usage where the protocol turns a unit about the vertical and the jig cannot: then nothing has
// moved.
Status check_protocol(JigProtocol protocol, const device::Jig& jig);

// usage also where constants of this filter do not help this unit; device_unavailable when it is
// unplugged; otherwise a report with any verdict.
Result<JigReport> run_jig(UnitOnJig on_jig, Env& env, const JigSessionOptions& options,
                          const JigHooks& hooks, const std::optional<JigResume>& resume = {});

}  // namespace sixpoint::station
