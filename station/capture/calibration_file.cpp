#include "station/capture/calibration_file.h"

#include <fmt/format.h>

#include "base/sha256.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/gate.h"
#include "repair/triage/survey.h"
#include "repair/triage/triage.h"

namespace sixpoint::station {

std::vector<std::string> why_recording_cannot_help(const RecordingOrigin& origin) {
  if (!origin.unit_is_here && !origin.serial.starts_with("MOS")) {
    return {fmt::format("{} is no wGT3X-BT, wActiSleep+ or wActiSleep-BT: its recordings "
                        "were never affected",
                        printable(origin.serial, 40)),
            "nothing needs to be done for this unit"};
  }
  if (!origin.unit_is_here && !origin.filter) {
    return {"the file does not say under which filter it was recorded",
            "record it anew and download it with this program"};
  }
  if (origin.filter == calib::FilterConfiguration::legacy) {
    return {fmt::format("{} with firmware {} records under the filter 'legacy', for which its "
                        "stored constants are right; affected files were recorded under 'current'",
                        printable(origin.serial, 40), printable(origin.firmware, 40)),
            "install a firmware from 1.4.0 to 1.7.0 on this unit and record again, or have it "
            "measured on the jig ('sixpoint jig' sets the filter itself)"};
  }
  return {};
}

Result<CalibrationFileCheck> check_calibration_file(Env& env, const std::string& path,
                                                    const calib::SolveOptions& options) {
  SIXPOINT_ASSIGN(const repair::Survey survey, repair::survey(env.files, path));
  CalibrationFileCheck check;
  check.serial = survey.facts.serial;
  check.firmware = survey.facts.firmware;
  check.refusal = why_recording_cannot_help(
      {check.serial, check.firmware, repair::filter_in_force(survey.facts)});
  if (check.refusal.empty()) {
    if (std::string why = repair::why_not_lent(survey); !why.empty()) {
      check.refusal = {std::move(why), "name the original recording"};
      return check;
    }
    SIXPOINT_ASSIGN(check.sha256, file_sha256(env.files, path));
    SIXPOINT_ASSIGN(check.solved, repair::solve_survey(path, survey, options));
  }
  return check;
}

}  // namespace sixpoint::station
