// What became of one file (repair_file.h), for people, for programs and for the store.
//
//   RepairReport report;
//   report.input = "in.gt3x";
//   report.status = RepairStatus::not_affected;
//   report.brief();  // "not_affected     in.gt3x"
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/error.h"
#include "base/measure.h"
#include "base/time.h"
#include "gt3x/salvage_losses.h"
#include "repair/rescale/sources.h"

namespace sixpoint::repair {

enum class RepairStatus {
  repaired,
  not_affected,
  not_repairable,
  already_repaired,
  outdated,
  failed
};
std::string_view to_string(RepairStatus status);
std::optional<RepairStatus> parse_repair_status(std::string_view text);

// How far a run over many files is.
struct RepairProgress {
  std::size_t files = 0;
  std::uint64_t bytes = 0;  // of the inputs that are done
  std::size_t failed = 0;   // of the files
};

struct RepairReport {
  std::string input;
  std::string output;  // empty where none was written
  std::string linked;  // the name below the output folder that the input itself got, or empty
  RepairStatus status = RepairStatus::failed;
  std::string method;
  std::vector<std::string> reasons;
  std::optional<Error> error;  // with `failed`
  std::string serial;
  std::optional<UtcTime> calibration_time;  // of the stored constants, as the file states it
  std::uint64_t samples = 0;
  std::uint64_t clipped_before = 0;
  std::uint64_t clipped_after = 0;
  std::size_t still_blocks = 0;
  std::string verdict;  // of triage(); empty for a file that was not judged
  // Which sides were up in its still periods, by the file's own constants: out of "+x" ... "-z".
  std::vector<std::string> sides;
  // Mean of |magnitude - 1 g| over still blocks. `after` is that of the samples as they were
  // written, as the mark has it; of `not_repairable` what the constants would have made of them;
  // absent of `outdated` and `failed`.
  std::optional<double> still_error_before_mg;
  std::optional<double> still_error_after_mg;
  bool rotation_undone = false;
  bool resumed = false;  // repaired by an earlier run; method and constants are those of its mark
  std::string constants_id;
  std::optional<SourceUsed> source;
  bool for_a_person = false;  // no constants, because those that there are contradict each other
  bool forced = false;        // written although the gate or the file's own still periods said no
  bool cross_axis_applied = false;  // not only six constants (applied_map.h)
  // Standard uncertainty of a sample, X Y Z; absent where the constants state none.
  std::optional<PerAxis<double>> sample_uncertainty_mg;
  std::vector<gt3x::SalvageLoss> losses;  // with RepairOptions::salvage
  std::optional<UtcTime> repaired_at;     // as its mark says
  std::string input_sha256;
  std::string output_sha256;
  bool dry_run = false;
  // For a run over many files (repair_files.h); not part of the answer.
  bool waits_for_others = false;   // with RepairOptions::leave_unchecked
  bool refutes_constants = false;  // as gate.h has it

  // "repaired  in.gt3x  still error 112.3 -> 0.8 mg  by store 5c0f91aa (2026-11-22, +- 1.2 mg)"
  std::string brief() const;
  bool usable() const { return status != RepairStatus::failed; }
  nlohmann::ordered_json to_json() const;
};

// Which run of the same command, with --resume, can do a file that failed: at once, or when what its
// line asks for was done. The first row that fits decides:
//
// | the error                                             | next run                            |
// |-------------------------------------------------------|-------------------------------------|
// | its hint is one of those below                        | none: only another command can      |
// | no_input, permission, io, cannot_create               | same                                |
// | the file changed while it was repaired                | same                                |
// | bad_data that `--salvage` delivers (delivery.h), which| with_salvage                        |
// | was not given                                         |                                     |
// | any other                                             | none: the file stays what it is     |
enum class NextRun { none, same, with_salvage };
NextRun next_run(const Error& error, bool salvage);

// Hints that another output folder, or another run, is needed.
inline constexpr const char* kAnotherFolder = "choose another output folder";
inline constexpr const char* kFolderWithoutRecordings =
    "choose an output folder that holds no recordings";
inline constexpr const char* kSeparateRuns =
    "repair the two in separate runs, into separate folders";

inline constexpr const char* kChangedMeanwhile = "the file changed while it was repaired";

// The report of a file that could not be read at all.
RepairReport failed_report(const std::string& input, const Error& error);

}  // namespace sixpoint::repair
