// Who writes into an output folder at a time: one `repair`, or the shards of plans.
//
//   SIXPOINT_ASSIGN(const auto lock, lock_for_repair(files, "repaired"));  // held while it lives
//
// | who begins     | `repair` is at work there | a shard is at work there | no one, or killed ones |
// |----------------|---------------------------|--------------------------|------------------------|
// | `repair`       | is refused                | is refused               | begins                 |
// | a shard        | is refused                | begins                   | begins                 |
//
// A shard has a lock of its own in the folder, .sixpoint-shard-PLAN-NUMBER.lock, which it removes
// at its end; `repair` has .sixpoint-repair.lock. Each takes its own one first and then looks at
// those of the others, so of two that begin at once at least one sees the other. Two runs of one
// shard are kept apart by the plan (archive_run.h).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/env.h"

namespace sixpoint::repair {

// Both make the folder where it is not there. cannot_create for "is refused", and for a folder that
// holds another record (record_folder.h), whoever asks: a command, the station's page, Python, R;
// null where the folder's file system has no locks. `inputs`: what is repaired; usage where one of them
// is the folder itself, or a file in it: each recording would be its own output, and the manifest would
// lie among them.
Result<std::unique_ptr<FileLock>> lock_for_repair(FileSystem& files, const std::string& folder,
                                                  const std::vector<std::string>& inputs = {});
Result<std::unique_ptr<FileLock>> lock_for_shard(Env& env, const std::string& folder,
                                                 const std::string& plan_id, std::size_t shard);

// As FileSystem::lock(), tried again for two seconds: others hold a lock for a moment to find out
// whether a run does.
Result<std::unique_ptr<FileLock>> wait_for_lock(Env& env, const std::string& path);

}  // namespace sixpoint::repair
