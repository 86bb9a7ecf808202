#include "repair/archive/archive_merge.h"

#include <algorithm>
#include <numeric>

#include "base/sha256.h"

namespace sixpoint::repair {
namespace {

// A repaired file that is not what its shard wrote counts as failed. True where it is there: then no
// run of the shard replaces it.
bool verify(FileSystem& files, RepairReport& report) {
  if (report.status != RepairStatus::repaired) {
    return false;
  }
  const bool is_there = files.info(report.output).has_value();
  Error error;
  const auto digest = file_sha256(files, report.output);
  if (!digest) {
    error = digest.error();
  } else if (*digest != report.output_sha256) {
    error = {ErrorCode::bad_data, "the repaired file is not what the shard wrote", report.output,
             "remove it and run the shard again"};
  } else {
    return false;
  }
  report.status = RepairStatus::failed;
  report.reasons = {error.brief()};
  report.error = std::move(error);
  report.output.clear();
  return is_there;
}

}  // namespace

bool MergedArchive::complete() const {
  return std::all_of(shards.begin(), shards.end(),
                     [](const MergedShard& shard) { return shard.complete(); });
}

std::size_t MergedArchive::files_missing() const {
  return std::accumulate(shards.begin(), shards.end(), std::size_t{0},
                         [](std::size_t sum, const MergedShard& shard) {
                           return sum + (shard.complete() ? 0 : shard.files);
                         });
}

Result<MergedArchive> merge_archive(FileSystem& files, const std::string& folder,
                                    const ArchivePlan& plan, const MergeOptions& options) {
  MergedArchive merged;
  for (std::size_t k = 0; k < plan.shards.size(); ++k) {
    MergedShard shard;
    shard.shard = k;
    shard.files = plan.shards[k].files;
    shard.bytes = plan.shards[k].bytes;
    auto result = read_result(files, folder, plan, k);
    if (!result) {
      const ShardStanding standing = standing_of(files, folder, plan, k);
      // It may have come to its end since the line before.
      shard.state = standing.state == ShardState::done ? ShardState::running : standing.state;
      shard.plan_damaged = standing.plan_damaged;
      shard.files_done = standing.done.files;
      shard.bytes_done = standing.done.bytes;
      shard.failed = standing.done.failed;
      merged.shards.push_back(shard);
      continue;
    }
    shard.state = ShardState::done;
    shard.files_done = shard.files;
    shard.bytes_done = shard.bytes;
    for (RepairReport& report : result->files) {
      shard.touched += options.verify && verify(files, report) ? 1 : 0;
      shard.failed += report.status == RepairStatus::failed ? 1 : 0;
      shard.changed += has_changed_since_plan(report) ? 1 : 0;
    }
    merged.shards.push_back(shard);
    SIXPOINT_CHECK(options.visit(*result));
  }
  return merged;
}

}  // namespace sixpoint::repair
