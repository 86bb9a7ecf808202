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
// | directions | before -> after                              | row           | written      |
// |------------|----------------------------------------------|---------------|--------------|
// | 0          | -, the gate refused the same constants on    | refuted       | with `force` |
// |            | another file of the unit in this run         |               |              |
// | 0          | -                                            | not_checked   | yes          |
// | 1 or more  | after > before                               | worse         | with `force` |
// | 1 or more  | before <= 64 mg, and after > before - 1 mg   | no_better     | with `force` |
// | 1 or more  | as written, with counts rounded: not below   | rounded_away  | with `force` |
// |            | before (asked again before it is kept)       |               |              |
// | 1 to 3     | after > 20 mg                                | too_much_left | with `force` |
// | 4 or more  | after > 32 mg                                | too_much_left | with `force` |
// | 1 to 3     | before <= 32 mg, the counts may come from    | ambiguous     | with `force` |
// |            | other software                               |               |              |
// | 1 to 3     | otherwise                                    | weak          | yes          |
// | 4 or more  | otherwise                                    | helps         | yes          |
//
// 64 mg is the paper's limit of a file that needs no repair (Step 2). A file within it may have
// been corrected before by other software, which leaves serial number, date and firmware as they
// were. 32 mg are left only by constants of another unit or another filter: uncertainty,
// temperature and gravity together stay below 20 mg. In one to three directions wrong constants
// look right by chance more often, so the limit is 20 mg there.
//
// What the gate says of a file against its constants holds for the unit's files without still
// periods (refutes()):
//
// | row of the other file                                                      | refutes |
// |----------------------------------------------------------------------------|---------|
// | worse, too_much_left                                                       | yes     |
// | any, but its own still periods contradict the constants (agreement.h)      | yes     |
// | rounded_away, and more than 16 mg before: rounding hides no such gain      | yes     |
// | no_better, rounded_away, ambiguous: it may have been corrected before      | no      |
// | any other                                                                  | no      |
//
// May constants that are solved from a recording be used for other recordings? They undo the
// recording's own counts; these must be the sensor's (why_not_lent()):
//
// | the recording                                                                       | lends |
// |-------------------------------------------------------------------------------------|-------|
// | names two firmware versions that lay the axes, or set the filter, differently       | no    |
// | affected by its header, yet within 16 mg of 1 g by the constants stored in it, in 4 | no    |
// | or more directions, and the counts may come from other software                     |       |
// | any other                                                                           | yes   |
//
// 16 mg: what a corrected file is off at most, by temperature and by what six constants cannot tell
// (kUnitTolerance_mg, repair/units/unit_answer.h). Affected units are off by 100 mg (paper).
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "calib/constants.h"
#include "calib/still_blocks.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {

inline constexpr double kLeastGain_mg = 1;
inline constexpr double kMostLeft_mg = 32;
inline constexpr double kMostLeftInFewDirections_mg = 20;

// Fewer directions than this do not see every constant.
inline constexpr int kLeastDirections = 4;

inline constexpr double kMostOfCorrected_mg = 16;

struct GateEvidence {
  int directions = 0;  // in which the file has still blocks (calib/direction_cells.h)
  double before_mg = 0;
  double after_mg = 0;  // before counts are rounded
  // Only the unit's own constants make such counts: other software leaves counts that no integer
  // leads to. False where that cannot be told (calib/scaling.h, PlausibilityTally).
  bool counts_are_the_units_own = false;
  // After, of the samples that were written; nothing as long as they are not.
  std::optional<double> written_mg = std::nullopt;
  // Another file of the unit that refutes the same constants in this run; empty for none.
  std::string refuted_by = {};
};
// `cross_axis`: the terms xy, xz, yz that are applied with the constants; all zero for none.
GateEvidence gate_evidence(const Survey& survey, const calib::Calibration& fresh,
                           const PerAxis<double>& cross_axis = {});

enum class GateRow {
  refuted,
  not_checked,
  worse,
  no_better,
  rounded_away,
  too_much_left,
  ambiguous,
  weak,
  helps
};
struct GateAnswer {
  GateRow row = GateRow::not_checked;
  bool write = true;
  bool forced = false;  // written although the row says no
  std::string reason;   // for people; with both numbers where they decide; empty where it helps
};
GateAnswer gate(const GateEvidence& evidence, bool force);
bool refutes(GateRow row, const GateEvidence& evidence);

// What may help a file, or a unit's files, where the constants do not fit by the rows worse, no_better and
// too_much_left, or by their own still periods. `sides`: those that were up, of six.
//
// | their own still periods were asked for constants | sides | may help                      |
// |--------------------------------------------------|-------|-------------------------------|
// | no: the constants came from elsewhere            | six   | --scan in place of what there |
// |                                                  |       | was                           |
// | no                                               | fewer | the jig, a calibration file   |
// | yes                                              | any   | the jig, a calibration file   |
std::string what_may_help(bool own_asked, std::size_t sides);

// A sentence; empty where its constants may be lent. The survey is of the whole recording.
std::string why_not_lent(const Survey& survey);

// A sentence for a recording made under `legacy`: its constants repair no affected file, since those were
// recorded under `current`. Empty for all others.
std::string why_legacy_repairs_none(const FileFacts& facts);

}  // namespace sixpoint::repair
