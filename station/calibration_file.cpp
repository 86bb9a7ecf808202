#include "station/calibration_file.h"

#include <fmt/format.h>

#include "base/sha256.h"
#include "repair/constants_finder.h"
#include "repair/survey.h"
#include "repair/triage.h"

namespace sixpoint::station {

namespace {

Result<std::string> sha256_of(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const auto file, files.open(path));
  Sha256 hash;
  Bytes chunk(1U << 20U);
  for (std::uint64_t offset = 0; offset < file->size();) {
    SIXPOINT_ASSIGN(const std::size_t count, file->read_at(offset, chunk));
    if (count == 0) {
      break;
    }
    hash.update(std::span(chunk).first(count));
    offset += count;
  }
  return to_hex(hash.finish());
}

}  // namespace

Result<CalibrationFileCheck> check_calibration_file(Env& env, const std::string& path,
                                                    const calib::SolveOptions& options) {
  SIXPOINT_ASSIGN(const repair::Survey survey, repair::survey(env.files, path));
  CalibrationFileCheck check;
  check.serial = survey.facts.serial;
  check.firmware = survey.facts.firmware;
  const auto filter = repair::filter_in_force(survey.facts);
  if (!survey.facts.serial.starts_with("MOS")) {
    check.refusal = {fmt::format("{} is no wGT3X-BT, wActiSleep+ or wActiSleep-BT: its recordings "
                                 "were never affected",
                                 printable(check.serial, 40)),
                     "nothing needs to be done for this unit"};
  } else if (!filter) {
    check.refusal = {"the file does not say under which filter it was recorded",
                     "record it anew and download it with this program"};
  } else if (*filter == calib::FilterConfiguration::legacy) {
    check.refusal = {
        fmt::format("{} with firmware {} recorded under the filter 'legacy', for which its stored "
                    "constants are right; affected files were recorded under 'current'",
                    printable(check.serial, 40), printable(check.firmware, 40)),
        "install a firmware from 1.4.0 to 1.7.0 on this unit and record again, or send it in to be "
        "measured on the jig"};
  }
  if (!check.refusal.empty()) {
    return check;
  }
  SIXPOINT_ASSIGN(check.sha256, sha256_of(env.files, path));
  SIXPOINT_ASSIGN(check.solved, repair::solve_survey(path, survey, options));
  return check;
}

}  // namespace sixpoint::station
