// What a jig run ends with: the constants, how they did on readings that they were not made from,
// the verdict, and everything that the store and the certificate need to say so again years later.
//
// Made by run_jig() (jig_session.h); a value, of any thread.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/measure.h"
#include "calib/constants.h"
#include "calib/gravity.h"
#include "calib/six_pose.h"
#include "device/unit.h"
#include "station/jig_run.h"
#include "station/limits.h"
#include "station/verdict.h"

namespace sixpoint::station {

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

}  // namespace sixpoint::station
