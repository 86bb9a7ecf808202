// The plan of an archive: which files are repaired, in how many shards, with which constants.
//
//   ArchiveDraft draft;
//   draft.paths = {"/data/archive"};
//   draft.shards = 4;
//   SIXPOINT_ASSIGN(PlannedArchive planned, plan_archive(env, draft));
//   SIXPOINT_CHECK(write_plan(env, "/data/plan", draft, planned));   // plan_folder.h
//
// plan_archive() reads and writes nothing but names, sizes, times and, where asked for, hashes of
// files. ask_units() also reads the affected files: what one file of a unit lacks another may hold,
// in another shard (repair/units/unit_answer.h).
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/env.h"
#include "repair/archive/link_file.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/constants_snapshot.h"
#include "repair/rescale/repair_file.h"
#include "repair/triage/file_tree.h"
#include "repair/units/unit_pool.h"

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

// How the files are repaired, as `repair` takes it; the same for every shard.
struct ArchiveRepair {
  RepairOptions options;  // wide, store_only, undo_rotation, allow_prior, force
  // What the user named, as ConstantsFinderOptions has it.
  std::optional<calib::ConstantsRecord> given;
  std::optional<ArchiveCalibrationFile> calibration_file;
  bool scan = false;
  bool store_named = false;
  bool or_scan = false;
  bool no_pool = false;
  LinkKind link_unaffected = LinkKind::none;  // link_unaffected.h
};

struct ArchivePlan {
  std::string id;  // SHA-256 of plan.json's content
  UtcTime made_at{};
  std::string software;
  std::vector<ArchiveRoot> roots;
  std::vector<ArchiveShard> shards;
  std::vector<RefusedPath> refused;  // files that no shard can repair, and why
  ArchiveRepair repair;
  std::string store;  // that keeps what was repaired, without a password; empty: no store
  std::string constants_sha256;  // of constants.jsonl; empty: no store is asked for constants
  std::string units_sha256;      // of units.jsonl; empty: the units' other files are not asked

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
  std::optional<UnitAnswers> units;       // of ask_units()
};

// Without a given size: no more than what Slurm takes as it comes (MaxArraySize 1001).
inline constexpr std::size_t kUsualMostShards = 1000;
inline constexpr std::size_t kMostShards = 100'000;

// Reads the folders and writes nothing. no_input where a path is not there or there is no file;
// usage where more shards are asked for than kMostShards.
Result<PlannedArchive> plan_archive(Env& env, const ArchiveDraft& draft);

// The sources of constants that a plan names, with `snapshot` (which may be null) for its store;
// the unit's other files are the caller's to add.
ConstantsFinderOptions finder_options(const ArchiveRepair& repair,
                                      const ConstantsSnapshot* snapshot);

// Would a repair ask the unit's other files at all? Not where other sources are named alone, nor
// with no_pool.
bool asks_units(const ArchiveRepair& repair, const ConstantsSnapshot* snapshot);

// How the files are looked at: work(i) for every i below `count`, on as many threads as the caller
// wants.
using ForEach =
    std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)>;
// Fills in planned.units, with `snapshot` for the store; one pass over the affected files. Reads
// the calibration file where there is one.
void ask_units(Env& env, const ConstantsSnapshot* snapshot, const ForEach& for_each,
               PlannedArchive& planned);

// Where to cut a list of files so that no shard is larger than it must be: the ends of the shards,
// in order. The files stay in order; no shard is empty.
std::vector<std::size_t> cut_into_shards(const std::vector<std::uint64_t>& bytes,
                                         std::size_t shards);

}  // namespace sixpoint::repair
