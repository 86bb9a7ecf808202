// What the subcommands of `archive` share: their options, and paths that hold in every task.
//
//   SIXPOINT_CHECK(run_archive_plan(options, context));
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cli/context.h"
#include "cli/files/repair_answer.h"
#include "cli/output.h"
#include "repair/archive/archive_plan.h"
#include "repair/archive/archive_run.h"

namespace sixpoint::cli {

// Of all subcommands, because only one of them runs.
struct ArchiveOptions {
  std::vector<std::string> paths;
  std::string plan;    // the folder of the plan
  std::string output;  // plan: its folder; run: the folder for repaired files
  RepairSources sources;
  repair::ArchiveDraft draft;  // as far as the options describe it
  std::size_t shard = 0;
  unsigned jobs = 0;
  unsigned threads = repair::ShardRunOptions{}.threads;  // of 'run', for one file
  std::vector<std::string> sbatch;                       // options for it
  bool verify = false;
  bool redo_outdated = false;
  bool dry_run = false;
  OutputOptions outputs;
  bool json = false;
};

// Tasks run in other folders. ".." stays: after a link it leads elsewhere than the path says.
std::string absolute(const std::string& path);

// A progress bar that appears with the library's first call.
std::function<void(std::size_t, std::size_t)> show_in(std::optional<Progress>& progress,
                                                      Context& context, std::string doing);

Status run_archive_plan(const ArchiveOptions& options, Context& context);
Status run_archive_submit(const ArchiveOptions& options, Context& context);

}  // namespace sixpoint::cli
