// The result of a jig run: the constants, their residuals on readings that the fit did not use, the
// verdict, and all that the store and the certificate need.
//
//   SIXPOINT_ASSIGN(const JigReport report, run_jig({&unit, &jig}, env, options, hooks));
//   if (report.usable()) {
//     const calib::Calibration& constants = report.six->best().calibration;
//   }
//
// Made by run_jig() (jig_session.h). Plain data; any thread.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/measure.h"
#include "calib/constants.h"
#include "calib/poses/gravity.h"
#include "calib/poses/six_pose.h"
#include "device/unit.h"
#include "station/limits/limits.h"
#include "station/limits/verdict.h"
#include "station/run/jig_run.h"

namespace sixpoint::station {

// One reading against constants: the length of the vector minus local gravity.
struct JudgedPose {
  PoseReading reading;
  double magnitude_g = 0;
  double error_mg = 0;
  bool chose = false;  // it chose between the solutions, so it does not judge
};
struct JudgedPoses {
  std::vector<JudgedPose> poses;
  std::size_t judging = 0;  // poses that the two numbers are made of: those that did not choose
  double worst_mg = 0;
  double rms_mg = 0;
};
// `choosing`: which of the readings chose between the solutions (SixPoseReport::choosing).
JudgedPoses judge(const std::vector<PoseReading>& readings, const calib::Calibration& calibration,
                  double gravity_g, const std::vector<std::size_t>& choosing = {});

// null where there is none.
nlohmann::ordered_json page_to_json(const std::optional<device::CalibrationPage>& page);

struct JigReport {
  std::string serial;
  std::string firmware;
  std::string jig;
  calib::FilterConfiguration filter = calib::FilterConfiguration::current;
  JigProtocol protocol = JigProtocol::production;
  UtcTime started{};
  UtcTime ended{};
  JigVerdict verdict = JigVerdict::inconclusive;
  std::vector<std::string> codes;    // of verdict.h's catalogue; empty for a pass
  bool is_last_failure = false;      // verdict.h
  std::vector<std::string> reasons;  // for people
  Limits limits;
  std::vector<JudgedQuantity> quantities;  // empty where the run did not get that far
  // Why the run ended early, where it did; the verdict is inconclusive then.
  std::optional<Error> ended_by;
  calib::LocalGravity gravity;

  std::vector<PoseReading> faces;
  // With production+: three faces turned by half a turn. For the diagnosis alone: neither constants
  // nor verdict use them.
  std::vector<PoseReading> half_turn;
  // The three solutions, the choice among them by unused readings, and the verdict on it.
  std::optional<calib::SixPoseReport> six;
  std::string method;  // "six_pose_letter" (Eq. 1-6 to the letter), "six_pose_pair" ...
  JudgedPoses verification;
  // Standard uncertainty of the chosen constants: noise, tilt and gravity as the fit has them, and
  // what the constants leave on unused poses.
  calib::ConstantsUncertainty combined;
  double rounded_residual_mg = 0;  // of the nine integers, on the same readings

  std::optional<device::CalibrationPage> as_found;
  std::optional<double> as_found_residual_mg;  // of the page's constants, on the faces
  // As read back from the unit; as_found where no write was begun; none where no one knows.
  std::optional<device::CalibrationPage> as_left;
  bool write_begun = false;  // and what the unit held after it was not read
  bool written = false;
  JudgedPoses recheck;  // with the constants that were read back
  int refusals = 0;
  device::StreamStatistics stream;  // of the whole run: over replugs, a write, and restarts
  std::string raw_csv;              // every sample of the run: device_time_us,x,y,z,temperature_c

  bool usable() const { return is_passed(verdict); }
  // Sets as_left where nothing was read back, by this table:
  //
  //     write_begun   as_left before   as_left after
  //     no            none             as_found: the unit was not touched
  //     no            read back        as it is
  //     yes           any              none, with a reason: old or new constants, no one knows
  void settle_as_left();
  std::string brief() const;
  // The contract's keys but `run`, `stored_id` and `certificate`.
  nlohmann::ordered_json to_json() const;
  std::string raw_sha256() const;  // of raw_csv, which the store keeps
  // For the store. Only of a usable report.
  calib::ConstantsRecord record() const;
};

}  // namespace sixpoint::station
