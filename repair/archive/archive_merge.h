// The results of all shards together: one answer, as one `repair` of the same files would give it, but
// for files without still periods (docs/repair.md, "When it is not done").
//
//   SIXPOINT_ASSIGN(const MergedArchive merged, merge_archive(files, "/data/plan", plan, {}));
//   if (!merged.complete()) {
//     std::cout << merged.files_missing() << " files have no result yet\n";
//   }
#pragma once

#include <functional>
#include <vector>

#include "repair/archive/archive_run.h"

namespace sixpoint::repair {

struct MergeOptions {
  // Also reads every repaired file and compares it with the hash that the shard wrote.
  bool verify = false;
  // Given every result that there is, in the order of the shards, one in memory at a time. An error
  // of it ends the merge.
  std::function<Status(const ShardResult&)> visit = [](const ShardResult&) { return Status(); };
};

struct MergedShard {
  std::size_t shard = 0;
  ShardState state = ShardState::missing;
  std::size_t files = 0;
  std::size_t files_done = 0;
  std::uint64_t bytes = 0;  // of the inputs
  std::uint64_t bytes_done = 0;
  std::size_t failed = 0;     // files that the next run tries again
  std::size_t changed = 0;    // of these: has_changed_since_plan(), so the next run fails again
  std::size_t touched = 0;    // of these: not as the shard wrote them (MergeOptions::verify)
  bool plan_damaged = false;  // as in ShardStanding

  // What running the shard once more can change:
  //
  // | the shard                                                   | wants a rerun |
  // |-------------------------------------------------------------|---------------|
  // | some run is at work on it                                   | no: wait      |
  // | is not done, its list of files is as the plan wrote it      | yes           |
  // | ... was changed or is gone                                  | no            |
  // | is done, and files failed                                   | yes           |
  // | ... because they changed since the plan was made, or are    | no            |
  // |     gone                                                    |               |
  // | ... because their outputs are there and not as it wrote them| no: a run     |
  // |     (a person looks at them and removes them first)         | replaces none |
  bool wants_rerun() const {
    return complete() ? failed > changed + touched : state != ShardState::running && !plan_damaged;
  }
  bool wants_another_plan() const { return plan_damaged || changed > 0; }
  bool complete() const { return state == ShardState::done; }
};

struct MergedArchive {
  std::vector<MergedShard> shards;  // all of the plan

  bool complete() const;
  std::size_t files_missing() const;  // of shards without a result
};

// Errors of single shards stand in their states.
Result<MergedArchive> merge_archive(FileSystem& files, const std::string& folder,
                                    const ArchivePlan& plan, const MergeOptions& options);

}  // namespace sixpoint::repair
