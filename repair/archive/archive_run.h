// One shard of an archive: mended file by file, by the same code as `repair`, and its result.
//
// A shard may be run as often as one likes, on any machine, and after any interruption: what is
// done is not done again. Every so often, and at the end, what was done is written into the plan's
// results/ (written beside, synced, renamed, folder synced), the outputs appear whole or not at
// all, and an output that is there without a result is known by its mark. Two runs of one shard at
// a time are refused by a lock. Files that failed are tried again by the next run.
//
//   results/output.json            the output folder, the same for all shards
//   results/00000.parts/000001.jsonl  what a run that has not ended did so far
//   results/00000.jsonl            the result of the whole shard
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "repair/archive_plan.h"

namespace sixpoint::repair {

struct ShardRunOptions {
  std::size_t shard = 0;
  std::string output_folder;  // write an absolute path; made where it is not there
  // Looks and computes; writes neither outputs nor results.
  bool dry_run = false;
  // What was done is written down after so many files or seconds, whichever comes first: what a
  // kill costs is at most this.
  std::size_t checkpoint_files = 128;
  std::chrono::seconds checkpoint_after{30};
  std::string software;
  std::function<void(std::size_t done, std::size_t files)> progress = [](auto, auto) {};
};

struct ShardResult {
  std::size_t shard = 0;
  std::string output_folder;
  std::string software;             // of the run that ended it
  std::vector<RepairReport> files;  // in the order of the manifest
  std::size_t done_before = 0;      // of them, by earlier runs
};

// cannot_create where another run holds the shard; usage where the output folder is another one
// than before, or where it and the archive lie in one another; configuration where the calibration
// file is not the one of the plan; io where results cannot be written. What becomes of single files
// stands in their reports: bad_data for one that changed since the plan was made.
Result<ShardResult> run_shard(Env& env, const std::string& folder, const ArchivePlan& plan,
                              const ShardRunOptions& options);

// The result of a whole shard; no_input where there is none yet, bad_data for one that is damaged
// or belongs to another plan.
Result<ShardResult> read_result(FileSystem& files, const std::string& folder,
                                const ArchivePlan& plan, std::size_t shard);

enum class ShardState {
  done,     // a result for every file
  running,  // some run holds it
  partly,   // a run was stopped; the next one goes on
  missing,  // no run has begun
  damaged,  // its result cannot be read: run it again
};
std::string_view to_string(ShardState state);

struct ShardStanding {
  ShardState state = ShardState::missing;
  std::size_t files_done = 0;
};
ShardStanding standing_of(FileSystem& files, const std::string& folder, const ArchivePlan& plan,
                          std::size_t shard);

// The output folder of the plan's runs; nothing before the first.
Result<std::optional<std::string>> output_folder_of(FileSystem& files, const std::string& folder);

}  // namespace sixpoint::repair
