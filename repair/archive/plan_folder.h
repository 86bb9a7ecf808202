// A plan on disk: a folder that is written once and never changed (docs/archive.md). plan.json
// comes last, so the plan is there whole or not at all.
//
//   SIXPOINT_ASSIGN(const ArchivePlan plan, read_plan(env.files, "/data/plan"));
//   SIXPOINT_ASSIGN(const auto files, read_manifest(env.files, "/data/plan", plan, 0));
//
//     plan.json           roots, options, shards with the SHA-256 of their manifests
//     shards/00000.jsonl  one line per file: root, path below it, size, time of its last change
//     constants.jsonl     what the store held, where there was one
//     units.jsonl         what the files of each unit give together, where they are asked
//     run.sbatch          the shards as a Slurm job array
//     merge.sbatch        the merge, as a job behind the array
//     run_all.sh          the shards on this machine
//     results/            what the shards answer (shard_results.h)
//
// File names may be any bytes; archive_json.h says how they are written.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "repair/archive/archive_plan.h"

namespace sixpoint::repair {

// Writes the plan into `folder`, which is made, and fills in its id and hashes. cannot_create where
// there is a plan already.
Status write_plan(Env& env, const std::string& folder, const ArchiveDraft& draft,
                  PlannedArchive& planned);

// no_input where there is no plan, bad_data for one that is damaged, configuration for one that was
// changed by hand or by a newer version.
Result<ArchivePlan> read_plan(FileSystem& files, const std::string& folder);
// The files of one shard. usage for a shard that is not in the plan; bad_data for a manifest that
// names files outside of its root.
Result<std::vector<ArchiveFile>> read_manifest(FileSystem& files, const std::string& folder,
                                               const ArchivePlan& plan, std::size_t shard);
// What the files of each unit give together; nothing where they are not asked.
Result<std::optional<UnitAnswers>> read_units(FileSystem& files, const std::string& folder,
                                              const ArchivePlan& plan);
// The constants of the store; nothing where the plan was made without one.
Result<std::optional<ConstantsSnapshot>> read_snapshot(FileSystem& files, const std::string& folder,
                                                       const ArchivePlan& plan);

}  // namespace sixpoint::repair
