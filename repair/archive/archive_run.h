// One shard of an archive: repaired file by file, by the same code as `repair`, and its result.
//
//   ShardRunOptions options;
//   options.shard = 0;
//   options.output_folder = "/data/repaired";
//   SIXPOINT_ASSIGN(const ShardResult result, run_shard(env, "/data/plan", plan, options));
//
// A shard may be run any number of times, on any machine, and after any interruption: what is done
// is not done again. At regular intervals, and at the end, what was done is written into the plan's
// results/ (shard_results.h; written beside, synced, renamed, folder synced), the outputs appear
// whole or not at all, and an output that is there without a result is known by its mark. Two runs
// of one shard at a time are refused by a lock, and so is a shard whose output folder `repair` is
// at work in (output_lock.h). Files that failed are tried again by the next run.
// results/output.json names the output folder, the same for all shards.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "repair/archive/link_unaffected.h"
#include "repair/archive/shard_results.h"

namespace sixpoint::repair {

struct ShardRunOptions {
  std::size_t shard = 0;
  std::string output_folder;  // write an absolute path; made where it is not there
  // Reads and computes; writes neither outputs nor results.
  bool dry_run = false;
  // Replaces outputs that were made otherwise than the plan makes them (earlier_output.h).
  bool redo_outdated = false;
  // Threads that deflate one file. 1: on a cluster a task has one core, and the tasks fill the
  // node.
  unsigned threads = 1;
  // Asked before every file: true ends the run there. What is done is written down.
  std::function<bool()> stop = [] { return false; };
  // What was done is written down after so many files or seconds, whichever comes first: what a
  // kill costs is at most this.
  std::size_t checkpoint_files = 128;
  std::chrono::seconds checkpoint_after{30};
  std::string software;
  // Makes the links of ArchiveRepair::link_unaffected; not called for `none`.
  LinkMaker make_link = [](const auto&, const auto& to, LinkKind) -> Status {
    return fail(ErrorCode::cannot_create, "this run makes no links", to);
  };
  // Of the shard, with what earlier runs did.
  std::function<void(const RepairProgress& done, std::size_t files)> progress =
      [](const RepairProgress&, auto) {};
};

// cannot_create where another run holds the shard, or `repair` the output folder; usage where the
// output folder is another one than before, or where it and the archive lie in one another;
// configuration where the calibration file is not the one of the plan; io where results cannot be
// written. What becomes of single files stands in their reports: bad_data for one that changed
// since the plan was made.
Result<ShardResult> run_shard(Env& env, const std::string& folder, const ArchivePlan& plan,
                              const ShardRunOptions& options);

// Whether the file failed because it is not as it was when the plan was made, or is gone: only another
// plan is without it, or takes it as it is.
bool has_changed_since_plan(const RepairReport& report);

// The output folder of the plan's runs; nothing before the first.
Result<std::optional<std::string>> output_folder_of(FileSystem& files, const std::string& folder);

}  // namespace sixpoint::repair
