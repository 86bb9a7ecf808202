// What a shard has done, on disk and file by file.
//
//   SIXPOINT_ASSIGN(const ShardResult result, read_result(env.files, "/data/plan", plan, 0));
//   result.files[0].status;   // the first file of the shard's manifest
//
//     results/00000.parts/000001.jsonl  what a run that has not ended did so far
//     results/00000.jsonl               the result of the whole shard
//     results/00000.lock                held by the run
//
// Each file: a first line with the plan's id and the SHA-256 of the rest, then one line per file.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "repair/archive/plan_folder.h"

namespace sixpoint::repair {

struct ShardResult {
  std::size_t shard = 0;
  std::string output_folder;
  std::string software;             // of the run that ended it
  std::vector<RepairReport> files;  // in the order of the manifest
  std::size_t done_before = 0;      // how many of them earlier runs did
  bool stopped = false;             // the rest of the shard is not done yet
};

// The result of a whole shard; no_input where there is none yet, bad_data for one that is damaged
// or belongs to another plan.
Result<ShardResult> read_result(FileSystem& files, const std::string& folder,
                                const ArchivePlan& plan, std::size_t shard);

enum class ShardState {
  done,     // a result for every file
  running,  // some run holds it
  partly,   // a run was stopped; the next one goes on
  missing,  // no run has begun
  damaged,  // its result cannot be read: run it again, but for ShardStanding::plan_damaged
};
std::string_view to_string(ShardState state);

struct ShardStanding {
  ShardState state = ShardState::missing;
  // `damaged`, and no run can mend it: the plan's list of the shard's files is not as the plan
  // wrote it, or is gone.
  bool plan_damaged = false;
  RepairProgress done;  // as it was last written down
};
ShardStanding standing_of(FileSystem& files, const std::string& folder, const ArchivePlan& plan,
                          std::size_t shard);

// One file more, and of all files that have a report.
void add_to(RepairProgress& done, const ArchiveFile& file, const RepairReport& report);
RepairProgress progress_of(const std::vector<ArchiveFile>& manifest,
                           const std::vector<std::optional<RepairReport>>& reports);

// Reports of some files of a shard, as they are written.
struct ShardReports {
  std::string output_folder;
  std::string software;
  std::vector<std::pair<std::size_t, RepairReport>> reports;  // by their place in the manifest
};

// One shard's files in results/. For archive_run.cpp.
class ShardFolder {
 public:
  // `plan` must live as long as this.
  static Result<ShardFolder> open(FileSystem& files, const std::string& folder,
                                  const ArchivePlan& plan, std::size_t shard);

  const std::vector<ArchiveFile>& manifest() const { return manifest_; }
  std::string input_of(std::size_t i) const { return plan_->input_of(manifest_[i]); }
  std::string result_path() const { return path_ + ".jsonl"; }
  std::string lock_path() const { return path_ + ".lock"; }
  // A folder of its own for each shard: listing one folder of all shards would cost every shard
  // more the more there are.
  std::string parts_folder() const { return path_ + ".parts"; }
  // The parts of runs that did not end, in the order in which they were written, and temporary
  // files of them (which read() takes for damaged).
  std::vector<std::string> parts() const;

  Status write(const std::string& path, const ShardReports& reports) const;
  Result<ShardReports> read(const std::string& path) const;
  // The result; bad_data where it does not have all files.
  Result<ShardReports> read_whole() const;
  // What earlier runs did, file by file.
  std::vector<std::optional<RepairReport>> known() const;

 private:
  ShardFolder(FileSystem& files, std::string path, const ArchivePlan& plan, std::size_t shard,
              std::vector<ArchiveFile> manifest)
      : files_(&files),
        path_(std::move(path)),
        plan_(&plan),
        shard_(shard),
        manifest_(std::move(manifest)) {}
  Result<ShardReports> parse(std::string_view text) const;

  FileSystem* files_;
  std::string path_;
  const ArchivePlan* plan_;
  std::size_t shard_;
  std::vector<ArchiveFile> manifest_;
};

}  // namespace sixpoint::repair
