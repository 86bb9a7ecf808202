// The triage of one file: is it affected by 16CPAN03, and do its samples show it?
//
//   const ScannedFile file = scan_file(env.files, "a.gt3x");
//   file.verdict;      // "affected"
//   file.evidence_mg;  // 83.1
//
//     file                                             verdict
//     cannot be read                                   unreadable, with `error`
//     carries our mark, its still periods fit          not_affected
//     carries our mark, has no still periods           not_affected, and the reasons say so
//     carries our mark, they are beyond 64 mg          cannot_tell: wrong constants, or a defect
//     any other                                        as triage() says (repair/triage/triage.h)
//
// An .agd names no date of calibration: it is taken from the recording of the same unit and name
// that lies beside it, and where there is none, from who asks (a store, known_calibration.h).
//
// Of a file without our mark the samples are a reason and do not change the verdict. Safe to call
// from several threads.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "repair/triage/triage.h"

namespace sixpoint::repair {

// Paper, Step 2: still points further than this from 1 g show that a file needs repair.
inline constexpr double kEvidenceLimit_mg = 64;

struct ScannedFile {
  std::string path;
  std::string verdict;  // affected, not_affected, cannot_tell, unreadable
  std::vector<std::string> reasons;
  FileFacts facts;
  // 95th percentile of the distance of the still blocks' magnitude from 1 g.
  std::optional<double> evidence_mg;
  bool axes_rotated = false;
  std::vector<std::string>
      sides;  // up in still periods, by the file's own constants (calib/coverage.h)
  std::optional<Error> error;
};

// A unit's date of calibration as something else than the file knows it.
struct KnownDate {
  std::optional<UtcTime> time;
  std::string why;  // one sentence for the reasons; empty where nothing is known
};
// Asked for a serial number. Must be safe to call from several threads.
using CalibrationLookup = std::function<KnownDate(const std::string& serial)>;

// Never fails as a function: what went wrong is in the answer.
ScannedFile scan_file(FileSystem& files, const std::string& path,
                      const CalibrationLookup& lookup = {});
ScannedFile unreadable_file(const std::string& path, const Error& error);

}  // namespace sixpoint::repair
