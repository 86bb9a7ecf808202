// Does a repair help? The last question before a file is written.
//
//   const GateEvidence evidence = gate_evidence(survey, constants);
//   const GateAnswer answer = gate(evidence, /*force=*/false);
//   answer.write;   // false
//   answer.reason;  // "the repair would make it worse: still error 12.3 mg before, ..."
//
// The still error is the mean of |magnitude - 1 g| over the still blocks: of the file as it is, and
// of what the constants would make of the same blocks. Charging zeros are in no still block. The
// first row that fits decides:
//
// | still blocks | before -> after                             | row           | written      |
// |--------------|---------------------------------------------|---------------|--------------|
// | none         | -                                           | not_checked   | yes          |
// | some         | after > before                              | worse         | with `force` |
// | some         | before <= 64 mg, and after > before - 1 mg  | no_better     | with `force` |
// | some         | after > 32 mg                               | too_much_left | with `force` |
// | some         | otherwise                                   | helps         | yes          |
//
// 64 mg is the paper's limit of a file that needs no repair (Step 2). A file within it may have
// been corrected before by other software, which leaves serial number, date and firmware as they
// were. 32 mg are left only by constants of another unit or another filter: uncertainty,
// temperature and gravity together stay below 20 mg.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "calib/constants.h"
#include "calib/still_blocks.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {

inline constexpr double kLeastGain_mg = 1;
inline constexpr double kMostLeft_mg = 32;

struct GateEvidence {
  std::size_t still_blocks = 0;
  double before_mg = 0;
  double after_mg = 0;
};
GateEvidence gate_evidence(const Survey& survey, const calib::Calibration& fresh);

enum class GateRow { not_checked, worse, no_better, too_much_left, helps };
struct GateAnswer {
  GateRow row = GateRow::not_checked;
  bool write = true;
  bool forced = false;  // written although the row says no
  std::string reason;   // with both numbers; empty where it helps
};
GateAnswer gate(const GateEvidence& evidence, bool force);

}  // namespace sixpoint::repair
