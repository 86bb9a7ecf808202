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
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "calib/constants.h"
#include "calib/gravity.h"
#include "calib/six_pose.h"
#include "device/unit.h"
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

// One reading judged by constants: magnitude against local gravity.
struct JudgedPose {
  PoseReading reading;
  double magnitude_g = 0;
  double error_mg = 0;
};
struct JudgedPoses {
  std::vector<JudgedPose> poses;
  double worst_mg = 0;
  double rms_mg = 0;
};
JudgedPoses judge(const std::vector<PoseReading>& readings, const calib::Calibration& calibration,
                  double gravity_g);

struct JigReport {
  std::string serial;
  std::string firmware;
  std::string jig;
  calib::FilterConfiguration filter = calib::FilterConfiguration::current;
  UtcTime started{};
  UtcTime ended{};
  JigVerdict verdict = JigVerdict::inconclusive;
  std::vector<std::string> codes;    // of verdict.h's catalogue; empty for a pass
  std::vector<std::string> reasons;  // for people
  Limits limits;
  std::vector<JudgedQuantity> quantities;  // empty where the run did not get that far
  // Why the run ended early, where it did; the verdict is inconclusive then.
  std::optional<Error> ended_by;
  calib::LocalGravity gravity;

  std::vector<PoseReading> faces;
  // The three solutions, the choice among them by unused readings, and the verdict on it.
  std::optional<calib::SixPoseReport> six;
  std::string method;  // "six_pose_letter" (Eq. 1-6 to the letter), "six_pose_pair" ...
  JudgedPoses verification;
  // Standard uncertainty of the chosen constants: noise, tilt and gravity as the fit has them, and
  // what the constants leave on unused poses.
  calib::ConstantsUncertainty combined;
  double rounded_residual_mg = 0;  // of the nine integers, on the same readings

  std::optional<device::CalibrationPage> as_found;
  double as_found_residual_mg = 0;  // of the page's constants, on the faces
  std::optional<device::CalibrationPage>
      as_left;  // as read back; as_found where nothing was written
  bool written = false;
  JudgedPoses recheck;  // with the constants that were read back
  int refusals = 0;
  device::StreamStatistics stream;
  std::string raw_csv;  // every sample of the run: device_time_us,x,y,z,temperature_c

  bool usable() const { return is_passed(verdict); }
  std::string brief() const;
  // The contract's keys but `run`, `stored_id` and `certificate`.
  nlohmann::ordered_json to_json() const;
  std::string raw_sha256() const;  // of raw_csv, which the store keeps
  // For the store. Only of a usable report.
  calib::ConstantsRecord record() const;
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

nlohmann::ordered_json to_json(const JigProgress& progress);
Result<JigProgress> parse_jig_progress(const nlohmann::ordered_json& json);  // bad_data

}  // namespace sixpoint::station
