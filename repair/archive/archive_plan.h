// The plan of an archive: which files are mended, in how many shards, with which constants.
//
// A folder that is written once and never changed; plan.json comes last, so the plan is there whole
// or not at all (docs/archive.md has the layout):
//
//   plan.json           roots, options, shards with the SHA-256 of their manifests
//   shards/00000.jsonl  one line per file: root, path below it, size, time of its last change
//   constants.jsonl     what the store held, where there was one
//   run.sbatch          the shards as a Slurm job array
//   run_all.sh          the shards on this machine
//   results/            what the shards answer (archive_run.h)
//
// File names may be any bytes: in these files every byte that is no printable ASCII, and '%', is
// written %NN.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/env.h"
#include "repair/constants_snapshot.h"
#include "repair/file_tree.h"
#include "repair/repair_file.h"

namespace sixpoint::repair {

struct ArchiveFile {
  std::size_t root = 0;  // in ArchivePlan::roots
  std::string relative;  // below the root, and below the output folder
  std::uint64_t size = 0;
  std::int64_t modified_ns = 0;
  std::string sha256;  // empty unless the plan was made with hashes
};

struct ArchiveRoot {
  std::string path;
  bool whole = true;  // a folder that was named; else the folder of files that were named
};

struct ArchiveShard {
  std::size_t files = 0;
  std::uint64_t bytes = 0;
  std::string manifest_sha256;
};

struct ArchiveCalibrationFile {
  std::string path;
  std::string sha256;
};

// How the files are mended, as `repair` takes it; the same for every shard.
struct ArchiveRepair {
  RepairOptions options;  // wide, undo_rotation, allow_prior
  // Constants that the user named: nothing else is asked.
  std::optional<calib::ConstantsRecord> given;
  std::optional<ArchiveCalibrationFile> calibration_file;
};

struct ArchivePlan {
  std::string id;  // SHA-256 of plan.json's content
  UtcTime made_at{};
  std::string software;
  std::vector<ArchiveRoot> roots;
  std::vector<ArchiveShard> shards;
  std::vector<RefusedPath> refused;  // files that no shard can mend, and why
  ArchiveRepair repair;
  std::string store;  // where the constants came from, without a password; empty: no store
  std::string constants_sha256;  // of constants.jsonl; empty: no store

  std::size_t files() const;
  std::uint64_t bytes() const;
  std::string input_of(const ArchiveFile& file) const {
    return roots[file.root].path + "/" + file.relative;
  }
};

struct ArchiveDraft {
  std::vector<std::string> paths;  // files and folders; write absolute ones, tasks run elsewhere
  // How many shards; 0: as many as `shard_bytes` asks for.
  std::size_t shards = 0;
  // What one shard holds at most, but for a single larger file. 4 GiB are minutes of work, long
  // against the start of a task and short against a queue's limits. 0 stands for this default.
  std::uint64_t shard_bytes = 0;
  bool hash = false;  // SHA-256 of every file; else size and time of its last change
  ArchiveRepair repair;
  const ConstantsSnapshot* snapshot = nullptr;  // not owned; may be null
  std::string store;
  std::string software;
  std::string program = "sixpoint";  // as the scripts call it
  std::size_t at_once = 64;          // tasks that the array runs at a time
  std::function<void(std::size_t done, std::size_t files)> progress = [](auto, auto) {};
};

struct PlannedArchive {
  ArchivePlan plan;
  std::vector<ArchiveFile> files;         // of shard 0, then of shard 1 ...
  std::vector<std::string> not_followed;  // links that lead out of the trees
};

// Without a given size: no more than what Slurm takes as it comes (MaxArraySize 1001).
inline constexpr std::size_t kUsualMostShards = 1000;
inline constexpr std::size_t kMostShards = 100'000;

// Looks at everything and writes nothing. no_input where a path is not there or there is no file;
// usage where more shards are asked for than kMostShards.
Result<PlannedArchive> plan_archive(Env& env, const ArchiveDraft& draft);

// Where to cut a list of files so that no shard is larger than it must be: the ends of the shards,
// in order. The files stay in order; no shard is empty.
std::vector<std::size_t> cut_into_shards(const std::vector<std::uint64_t>& bytes,
                                         std::size_t shards);

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
// The constants of the store; nothing where the plan was made without one.
Result<std::optional<ConstantsSnapshot>> read_snapshot(FileSystem& files, const std::string& folder,
                                                       const ArchivePlan& plan);

std::string encode_path(std::string_view path);
Result<std::string> decode_path(std::string_view text);

}  // namespace sixpoint::repair
