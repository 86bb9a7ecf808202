// One file repaired: triage, constants, the new log, the mark; written whole or not at all.
//
//   ConstantsFinder finder(env, options);  // constants_finder.h
//   const RepairReport report = repair_file(env, "in.gt3x", "out.gt3x", finder, RepairOptions{});
//   report.brief();  // "repaired         in.gt3x  still error 112.3 -> 0.8 mg"
//
// The original is only ever read. The output is a .gt3x with the same entries in the same order, in
// which the samples alone differ (rescaled_log.h), and two marks: one more entry (kRepairMark),
// JSON with what was done, by which constants, to the file of which hash; and a record before the
// others of the log (kRepairMarkType), which stays when the archive is packed anew. What becomes of
// a file:
//
// | file                                                    | status                             |
// |---------------------------------------------------------|------------------------------------|
// | carries the mark                                        | already_repaired                   |
// | an .agd (epochs, no samples), scan_file(): not affected | not_affected                       |
// | ... affected, or cannot tell                            | not_repairable: make it again      |
// | triage: not affected, axes right or undo_rotation off   | not_affected                       |
// | triage: not affected, axes turned, undo_rotation on     | repaired, method `rotation`        |
// | triage: cannot tell                                     | not_repairable                     |
// | ... either of the two, with losses (salvage on)         | the same, method `salvage`: written|
// |                                                         | whole, samples as they were        |
// | affected, no constants that may be used (choose() below)| not_repairable                     |
// | ... that the file's own still periods contradict        | not_repairable, but with force     |
// | ... that do not help by the gate (gate.h)               | not_repairable, but with force     |
// | affected, with constants, output not there              | repaired                           |
// | ... the output's name is that of the recording itself   | failed: cannot_create              |
// |     (device and inode), or of a link to it              |                                    |
// | ... output there, done (earlier_output.h), resume on    | repaired, `resumed`; nothing done  |
// | ... output there, changed since it was written          | failed: cannot_create              |
// | ... output there, outdated                              | outdated; with redo_outdated       |
// |                                                         | replaced: repaired                 |
// | ... output there, otherwise                             | failed: cannot_create              |
// | not_repairable by now, an output of this input is there | outdated: it is never replaced     |
// | cannot be read or written                               | failed, with the error             |
// | changed or was replaced while it was read               | failed: bad_data, nothing written  |
//
// One pass or two: where the head of a large log, and constants that do not depend on the file
// (ConstantsSource::foreseen), say what will be written (not RepairOptions::wide, whose size the
// head does not say), the log is surveyed and written to the
// temporary file in the same pass. At its end everything is decided as always, from the whole
// survey; where that leads to other bytes, or to none, the temporary file is dropped, and what is
// written is written in a second pass. So the answer never depends on how it came about.
//
// Constants may be used when why_unfit() (sources.h) says nothing. Where they are not from the file
// itself, and its own still periods give a verified solution, the two must agree
// (calib/application/agreement.h).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "calib/constants.h"
#include "repair/rescale/earlier_output.h"
#include "repair/rescale/repair_report.h"
#include "repair/rescale/sources.h"
#include "repair/triage/survey.h"

namespace sixpoint::repair {

// Constants for one file, and where they came from.
struct ChosenConstants {
  calib::ConstantsRecord record;
  std::string method;        // store, calibration_file, scan, constants
  std::string constants_id;  // in the store, or empty
};

// What was found for a file: constants, or one reason per source why there are none.
struct ConstantsChoice {
  std::optional<ChosenConstants> chosen;
  std::vector<std::string> reasons;
  bool for_a_person = false;  // sets of the store contradict each other: none of them is chosen
};

// Finds constants for a surveyed file of `path`; called only for files that need them. Must be safe
// to call from several threads when several files are repaired at a time.
class ConstantsSource {
 public:
  virtual ~ConstantsSource() = default;
  virtual Result<ConstantsChoice> choose(const std::string& path, const Survey& survey) = 0;
  // What choose() will probably answer for a file that says this of itself; nothing where that
  // depends on its samples. As safe as choose().
  virtual std::optional<ChosenConstants> foreseen(const FileFacts& /*facts*/) {
    return std::nullopt;
  }
};

struct RepairOptions {
  // 16-bit records on request only: every reader knows the 12-bit form.
  bool wide = false;
  // Entries stored instead of deflated: larger, and written faster.
  bool store_only = false;
  // Threads that pack one file's output.
  unsigned jobs = 1;
  // Reads, chooses, computes and judges what lies at the output's name, but writes nothing.
  bool dry_run = false;
  // Also turn back the axes of files whose constants are right. Off: a file that 16CPAN03 does not
  // affect is left as it is, and the reasons say that its axes are turned.
  bool undo_rotation = false;
  // A prior over a model's constants is no measurement of this unit: used only when asked for.
  bool allow_prior = false;
  // Reads what is left of a damaged file (gt3x/container/delivery.h), leaves out of the log what is
  // no good record, and lists what was lost in the report and in both marks.
  bool salvage = false;
  // Writes what the gate or the file's own still periods refuse; the mark says so.
  bool force = false;
  // An output that is there already and was made from this very input, as it would be made now, is
  // taken as done.
  bool resume = false;
  // An output that was made otherwise than it would be made now is replaced.
  bool redo_outdated = false;
  // Of the output that may be there.
  std::optional<KnownOutput> known_output;
  // A file on which the gate cannot check the constants (it has no still periods) is not written:
  // its report says that it waits for what they do to the unit's other files.
  bool leave_unchecked = false;
  // GateEvidence::refuted_by (gate.h).
  std::string refuted_by;
  calib::StillBlockOptions still;
  // From so many bytes of log.bin on one pass is tried: below, two are as fast.
  std::uint64_t one_pass_from_bytes = std::uint64_t{4} << 20;
};

// Repairs `input` into `output`, whose folder is made when it is written. Never fails as a
// function: what went wrong stands in the report (`failed`, with the error).
RepairReport repair_file(Env& env, const std::string& input, const std::string& output,
                         ConstantsSource& source, const RepairOptions& options);

}  // namespace sixpoint::repair
