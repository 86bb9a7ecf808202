// sixpoint archive plan|run|submit|merge|report|status: an archive on a cluster, shard by shard
// (docs/archive.md).
#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/text/counted.h"
#include "cli/command.h"
#include "cli/files/archive_options.h"
#include "cli/files/file_stream.h"
#include "cli/files/repair_answer.h"
#include "cli/output.h"
#include "cli/people_text.h"
#include "cli/stop_request.h"
#include "cli/store_option.h"
#include "cli/workers.h"
#include "repair/archive/archive_merge.h"
#include "repair/archive/archive_plan.h"
#include "repair/archive/archive_run.h"
#include "repair/archive/plan_folder.h"
#include "repair/batch/manifest.h"
#include "repair/rescale/constants_finder.h"
#include "station/records/software.h"

namespace sixpoint::cli {
namespace {

using repair::ArchivePlan;
using repair::MergedArchive;
using repair::MergedShard;
using repair::RepairReport;
using repair::ShardResult;

// --- run

repair::ShardState state_of(const ArchiveOptions& options, const ShardResult& result) {
  if (options.dry_run) {
    return repair::ShardState::missing;
  }
  return result.stopped ? repair::ShardState::partly : repair::ShardState::done;
}

Status run_shard(const ArchiveOptions& options, Context& context) {
  const std::string folder = absolute(options.plan);
  SIXPOINT_ASSIGN(const auto plan, repair::read_plan(context.env.files, folder));
  Outputs outputs(context, {}, options.json);
  SIXPOINT_CHECK(outputs.working_folder("--output", absolute(options.output)));
  std::optional<Progress> progress;
  repair::ShardRunOptions how;
  how.shard = options.shard;
  how.output_folder = absolute(options.output);
  how.dry_run = options.dry_run;
  how.redo_outdated = options.redo_outdated;
  how.threads = options.threads;
  how.make_link = repair::link_file;
  StopRequest stop;
  how.stop = [&stop] { return stop.requested(); };
  how.software = station::software_and_build();
  how.progress = [&](const repair::RepairProgress& done, std::size_t files) {
    if (!progress) {
      progress.emplace(context, fmt::format("shard {}", options.shard), files);
    }
    progress->at(done.files, done.bytes, done.failed);
  };
  const auto result = repair::run_shard(context.env, folder, plan, how);
  progress.reset();
  if (!result) {
    return fail(result.error());
  }
  RepairTally tally;
  FileStream files(context, options.json);
  for (const RepairReport& report : result->files) {
    tally.add(context, report);
    files.add(report);
  }
  files.end({{"shards",
              {{{"shard", options.shard},
                {"state", repair::to_string(state_of(options, *result))},
                {"files", result->files.size()},
                {"done_before", result->done_before}}}},
             {"summary", tally.to_json(options.dry_run)}});
  if (!options.json) {
    if (result->done_before > 0) {
      context.people << fmt::format("{} of the files were done by earlier runs\n",
                                    result->done_before);
    }
    context.people << fmt::format("shard {}: ", options.shard) << tally.brief(options.dry_run);
  }
  if (result->stopped) {
    context.worsen(kExitStopped);
    context.people << fmt::format(
        "stopped: {} of the shard done; to go on:\n  sixpoint archive run {} --shard {} "
        "-o {}{}\n",
        counted(result->files.size(), "file"), bash_word(options.plan), options.shard,
        bash_word(options.output), options.redo_outdated ? " --redo-outdated" : "");
  }
  return {};
}

// --- merge

// The commands that run shards again: those that are not done, and those in which files failed.
class Rerun {
 public:
  Rerun(FileSystem& files, std::string plan) : plan_(std::move(plan)) {
    const auto output = repair::output_folder_of(files, absolute(plan_));
    output_ = output && *output ? bash_word(**output) : "OUTDIR";
  }
  std::string shard(std::size_t number) const {
    return fmt::format("sixpoint archive run {} --shard {} -o {}", bash_word(plan_), number,
                       output_);
  }
  std::string array(const std::vector<std::size_t>& shards) const {
    return fmt::format("sbatch --array={} {}/run.sbatch {}", fmt::join(shards, ","),
                       bash_word(plan_), output_);
  }

 private:
  std::string plan_;
  std::string output_;
};

Json shards_to_json(const MergedArchive& merged, const Rerun& rerun) {
  Json shards = Json::array();
  for (const MergedShard& shard : merged.shards) {
    shards.push_back(
        {{"shard", shard.shard},
         {"state", repair::to_string(shard.state)},
         {"files", shard.files},
         {"files_done", shard.files_done},
         {"bytes", shard.bytes},
         {"bytes_done", shard.bytes_done},
         {"failed", shard.failed},
         {"rerun", shard.wants_rerun() ? Json(rerun.shard(shard.shard)) : Json(nullptr)}});
  }
  return shards;
}

void print_missing(const MergedArchive& merged, const Rerun& rerun, Context& context) {
  std::vector<std::size_t> again;
  bool another_plan = false;
  for (const MergedShard& shard : merged.shards) {
    another_plan = another_plan || shard.wants_another_plan();
    if (shard.plan_damaged) {
      context.people << fmt::format(
          "shard {}: its list of {} files was changed after the plan was made\n", shard.shard,
          shard.files);
    } else if (shard.changed > 0) {
      context.people << fmt::format(
          "shard {}: {} of its {} files changed since the plan was made, or are gone\n",
          shard.shard, shard.changed, shard.files);
    }
    if (shard.touched > 0) {
      context.people << fmt::format(
          "shard {}: outputs of {} of its {} files are not as it wrote them, or cannot be read, "
          "and no run replaces them: look at them, remove what is wrong, then: {}\n",
          shard.shard, shard.touched, shard.files, rerun.shard(shard.shard));
    }
    if (shard.state == repair::ShardState::running) {
      context.people << fmt::format("shard {} is running ({} of {} files): wait for it\n",
                                    shard.shard, shard.files_done, shard.files);
    }
    if (!shard.wants_rerun()) {
      continue;
    }
    again.push_back(shard.shard);
    context.people << (shard.complete()
                           ? fmt::format(
                                 "shard {}: {} of its {} files failed; try them again: {}\n",
                                 shard.shard, shard.failed - shard.changed - shard.touched,
                                 shard.files, rerun.shard(shard.shard))
                           : fmt::format("shard {} is {} ({} of {} files): {}\n", shard.shard,
                                         repair::to_string(shard.state), shard.files_done,
                                         shard.files, rerun.shard(shard.shard)));
  }
  if (again.size() > 1) {
    context.people << fmt::format("or all of them: {}\n", rerun.array(again));
  }
  if (another_plan) {
    context.people
        << "make another plan ('sixpoint archive plan' into another folder), which "
           "takes files as they are now, and run it into the same output folder: what is "
           "repaired already is left as it is\n";
  }
}

// The sources of constants that the plan's shards ask.
std::vector<repair::SourceKind> asked_by(const ArchivePlan& plan) {
  const repair::ConstantsSnapshot any;  // that there is one decides
  return repair::sources_in_order(
      repair::finder_options(plan.repair, plan.store.empty() ? nullptr : &any));
}

// What became known of the archive, by the results of its shards.
class Merge {
 public:
  Merge(Context& context, const ArchiveOptions& options, const ArchivePlan& plan)
      : context_(context),
        options_(options),
        store_location_(options.sources.store.empty() ? plan.store : options.sources.store),
        table_(asked_by(plan)) {}

  // The store that is named, else the one that the constants came from; and the output folder,
  // which gets the manifest of the whole archive. Tasks that run at the same time leave none: each
  // would write over those of the others.
  Status open(const std::string& folder) {
    if (!store_location_.empty() && !options_.dry_run) {
      SIXPOINT_ASSIGN(auto opened, open_existing_store(context_, store_location_));
      store_.emplace(std::move(opened));
    }
    if (!options_.dry_run) {
      SIXPOINT_ASSIGN(manifest_folder_, repair::output_folder_of(context_.env.files, folder));
    }
    if (manifest_folder_) {
      SIXPOINT_CHECK(repair::check_manifest(context_.env.files, *manifest_folder_));
      // Not there where no file had to be written.
      SIXPOINT_CHECK(make_synced_folders(context_.env.files, *manifest_folder_));
    }
    files_.emplace(context_, options_.json);
    return {};
  }

  void add(const RepairReport& report) {
    tally_.add(context_, report);
    table_.add(report);
    files_->add(report);
    if (store_ && !report.constants_id.empty()) {
      constants_.insert(report.constants_id);
    }
    if (manifest_folder_) {
      reports_.push_back(report);
    }
  }

  void add(const ShardResult& result) {
    for (const RepairReport& report : result.files) {
      add(report);
    }
    if (!store_) {
      return;
    }
    Json kept_now =
        keep_repairs(context_, store_location_, *store_, result.files,
                     fmt::format("merge again (shard {})", result.shard), result.software);
    // A shard that is not in the store is the more important one to report.
    if (kept_.is_null() || (!kept_now.is_null() && kept_now["in"] != "store")) {
      kept_ = std::move(kept_now);
    }
  }

  void finish(const MergedArchive& merged) {
    if (!merged.complete()) {
      context_.worsen_as_incomplete();
    }
    const auto units = table_.rows();
    if (manifest_folder_) {
      report(repair::write_manifest(context_.env.files, *manifest_folder_, reports_,
                                    context_.env.clock.now(), station::software_and_build()));
      report(repair::write_units(context_.env.files, *manifest_folder_, units));
    }
    const Json withdrawn = withdrawn_since();
    const Rerun rerun(context_.env.files, options_.plan);
    files_->end({{"shards", shards_to_json(merged, rerun)},
                 {"summary", tally_.to_json(false)},
                 {"units", repair::units_json(units)},
                 {"complete", merged.complete()},
                 {"files_missing", merged.files_missing()},
                 {"withdrawn", withdrawn},
                 {"kept", kept_}});
    if (options_.json) {
      return;
    }
    print_units(context_, units);
    context_.people << tally_.brief(false);
    if (!merged.complete()) {
      context_.people << fmt::format("not complete: nothing is known of {} yet\n",
                                     counted(merged.files_missing(), "file"));
    }
    print_missing(merged, rerun, context_);
    if (merged.complete()) {
      next_step(context_, options_.json, {"archive", "report", options_.plan, "-o", "report.html"});
    }
  }

 private:
  void report(const Status& status) {
    if (!status) {
      report_error(context_, status.error());
    }
  }

  // The plan has the constants of the day on which it was made: those that were withdrawn since,
  // with the files that were repaired with them and not again.
  Json withdrawn_since() {
    std::map<std::string, std::pair<std::size_t, std::string>> withdrawn;
    if (store_ && *store_ && !constants_.empty()) {
      const auto recall = (*store_)->recall_list();
      report(recall ? Status() : Status(fail(recall.error())));
      for (const db::RecallEntry& entry : recall.value_or(std::vector<db::RecallEntry>{})) {
        if (constants_.contains(entry.repair.constants_id) && !entry.repaired_again_at) {
          auto& [files, reason] = withdrawn[entry.repair.constants_id];
          ++files;
          reason = entry.reason;
        }
      }
    }
    Json list = Json::array();
    for (const auto& [id, of] : withdrawn) {
      const auto& [files, reason] = of;
      list.push_back({{"constants", id}, {"files", files}, {"reason", reason}});
      context_.log().warn(
          "constants {} were withdrawn since the plan was made ({}), and {} {} repaired with them: "
          "repair by a new plan; 'sixpoint store recall {} --store {}' lists them",
          db::shown_id(id), printable(reason), counted(files, "file"), files == 1 ? "was" : "were",
          db::shown_id(id), bash_word(store_location_));
    }
    return list;
  }

  Context& context_;
  const ArchiveOptions& options_;
  const std::string store_location_;
  std::optional<Result<db::Store>> store_;
  std::optional<std::string> manifest_folder_;
  RepairTally tally_;
  repair::UnitTable table_;
  std::vector<RepairReport> reports_;
  std::set<std::string> constants_;  // of the store
  std::optional<FileStream> files_;
  Json kept_ = nullptr;
};

Status run_merge(const ArchiveOptions& options, Context& context) {
  const std::string folder = absolute(options.plan);
  SIXPOINT_ASSIGN(const auto plan, repair::read_plan(context.env.files, folder));
  Merge merge(context, options, plan);
  SIXPOINT_CHECK(merge.open(folder));
  for (const repair::RefusedPath& refused : plan.refused) {
    merge.add(failed_report(refused.path, refused.error));
  }
  std::optional<Progress> progress(std::in_place, context, "merging", plan.shards.size());
  repair::MergeOptions how;
  how.verify = options.verify;
  how.visit = [&](const ShardResult& result) -> Status {
    merge.add(result);
    progress->at(result.shard);
    return {};
  };
  const auto merged = repair::merge_archive(context.env.files, folder, plan, how);
  progress.reset();
  if (!merged) {
    return fail(merged.error());
  }
  merge.finish(*merged);
  return {};
}

// --- report

// The page about what is known so far; shards that are missing make the exit code 2.
Status run_report(const ArchiveOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.file("--output", options.output));
  const std::string folder = absolute(options.plan);
  SIXPOINT_ASSIGN(const auto plan, repair::read_plan(context.env.files, folder));
  std::vector<RepairReport> reports;
  for (const repair::RefusedPath& refused : plan.refused) {
    reports.push_back(failed_report(refused.path, refused.error));
  }
  repair::MergeOptions how;
  how.visit = [&](const ShardResult& result) -> Status {
    reports.insert(reports.end(), result.files.begin(), result.files.end());
    return {};
  };
  SIXPOINT_ASSIGN(const auto merged, repair::merge_archive(context.env.files, folder, plan, how));
  context.worsen(merged.complete() ? kExitPassed : kExitInconclusive);
  SIXPOINT_CHECK(write_study_report(context, outputs.files(), options.output,
                                    "Archive of the plan " + options.plan, reports));
  repair::UnitTable table(asked_by(plan));
  for (const RepairReport& report : reports) {
    table.add(report);
  }
  Json json = document("archive");
  json["files"] = reports.size();
  json["files_missing"] = merged.files_missing();
  json["complete"] = merged.complete();
  json["units"] = repair::units_json(table.rows());
  return print_answer(context, options.json, json,
                      fmt::format("{} in the report, {} without a result yet\n",
                                  counted(reports.size(), "file"), merged.files_missing()));
}

// --- status

// How far the archive is, and the reports that say `failed`.
Result<MergedArchive> standing(FileSystem& files, const std::string& folder,
                               const ArchivePlan& plan, std::vector<RepairReport>& failed) {
  repair::MergeOptions how;
  how.visit = [&](const ShardResult& result) -> Status {
    std::copy_if(
        result.files.begin(), result.files.end(), std::back_inserter(failed),
        [](const RepairReport& report) { return report.status == repair::RepairStatus::failed; });
    return {};
  };
  SIXPOINT_ASSIGN(auto merged, repair::merge_archive(files, folder, plan, how));
  // A finished shard may be running once more, for its files that failed.
  for (MergedShard& shard : merged.shards) {
    if (shard.complete() && shard.failed > 0) {
      shard.state = repair::standing_of(files, folder, plan, shard.shard).state;
    }
  }
  return merged;
}

Status run_status(const ArchiveOptions& options, Context& context) {
  const std::string folder = absolute(options.plan);
  SIXPOINT_ASSIGN(const auto plan, repair::read_plan(context.env.files, folder));
  std::vector<RepairReport> failed;
  SIXPOINT_ASSIGN(const auto merged, standing(context.env.files, folder, plan, failed));
  context.worsen(merged.complete() ? kExitPassed : kExitInconclusive);
  std::map<repair::ShardState, std::size_t> counts;
  repair::RepairProgress done;
  std::string text;
  for (const MergedShard& shard : merged.shards) {
    ++counts[shard.state];
    done.files += shard.files_done;
    done.bytes += shard.bytes_done;
    done.failed += shard.failed;
    text += fmt::format("shard {:05}  {:<8} {} of {} files, {} of {}{}\n", shard.shard,
                        repair::to_string(shard.state), shard.files_done, shard.files,
                        bytes_text(shard.bytes_done), bytes_text(shard.bytes),
                        shard.failed > 0 ? fmt::format(", {} failed", shard.failed) : "");
  }
  if (!options.json) {
    context.out << text;
    context.people << fmt::format("{} of {} shards, {} of {} files, {} of {} done, {} failed\n",
                                  counts[repair::ShardState::done], plan.shards.size(), done.files,
                                  plan.files(), bytes_text(done.bytes), bytes_text(plan.bytes()),
                                  done.failed);
    return {};
  }
  Json summary = {{"files", plan.files()},       {"files_done", done.files},
                  {"bytes", plan.bytes()},       {"bytes_done", done.bytes},
                  {"failed", done.failed},       {"refused", plan.refused.size()},
                  {"shards", plan.shards.size()}};
  for (const auto state :
       {repair::ShardState::done, repair::ShardState::running, repair::ShardState::partly,
        repair::ShardState::missing, repair::ShardState::damaged}) {
    summary[std::string(repair::to_string(state))] = counts[state];
  }
  FileStream files(context, /*json=*/true);
  for (const RepairReport& report : failed) {
    files.add(report);
  }
  files.end({{"shards", shards_to_json(merged, Rerun(context.env.files, options.plan))},
             {"summary", summary}});
  return {};
}

}  // namespace

void add_archive(CLI::App& app, Context& context) {
  CLI::App& group = add_group(app, "archive", "repair an archive on a cluster, shard by shard");
  auto [plan, options] = add_command<ArchiveOptions>(
      group, context, "archive", "plan", "write down what is repaired, in how many shards",
      run_archive_plan);
  plan.add_option("path", options.paths, "recordings (.gt3x) or folders of them")->required();
  plan.add_option("-o,--output", options.output, "the folder for the plan")->required();
  auto* shards = plan.add_option("--shards", options.draft.shards, "how many shards")
                     ->check(CLI::Range(std::size_t{1}, repair::kMostShards));
  plan.add_option("--shard-bytes", options.draft.shard_bytes,
                  "what a shard holds at most, such as 500MB (default: 4GB, 1000 shards at most)")
      ->transform(CLI::AsSizeValue(false))
      ->check(greater_than_zero())
      ->excludes(shards);
  plan.add_option("--at-once", options.draft.at_once,
                  "tasks of the Slurm array at a time (default: 64; 0: no limit)")
      ->check(CLI::Range(std::size_t{0}, repair::kMostShards));
  plan.add_flag("--hash", options.draft.hash,
                "know files by SHA-256, not by size and time of change: reads all of them");
  add_source_options(plan, options.sources);
  add_repair_options(plan, options.draft.repair.options);
  add_link_option(plan, options.draft.repair.link_unaffected);
  plan.add_flag("--dry-run", options.dry_run, "print what would be planned, write nothing");
  add_jobs_option(plan, options.jobs);
  const auto add = [&](const char* name, const char* about,
                       Status (*work)(const ArchiveOptions&, Context&)) {
    auto declared = add_command<ArchiveOptions>(group, context, "archive", name, about, work);
    declared.command.add_option("plan", declared.options.plan, "the folder of the plan")
        ->required();
    return declared;
  };
  auto [run, of_run] = add("run", "repair one shard; may be repeated", run_shard);
  run.add_option("--shard", of_run.shard, "which one, counted from 0")->required();
  run.add_option("-o,--output", of_run.output, "the folder for repaired files")->required();
  add_redo_option(run, of_run.redo_outdated);
  run.add_option("--jobs", of_run.threads, "threads that pack a file")
      ->check(CLI::Range(1U, repair::kMostJobs))
      ->capture_default_str();
  run.add_flag("--dry-run", of_run.dry_run, "compute everything, write nothing");
  auto [submit, of_submit] =
      add("submit", "hand the plan to Slurm: its shards, and the merge behind them",
          run_archive_submit);
  submit.add_option("-o,--output", of_submit.output, "the folder for repaired files")->required();
  submit
      .add_option("--sbatch", of_submit.sbatch,
                  "an option for sbatch, such as --sbatch=--partition=long; may be repeated")
      ->allow_extra_args(false);
  submit.add_flag("--dry-run", of_submit.dry_run, "print the commands, submit nothing");
  auto [merge, of_merge] =
      add("merge", "the answers of all shards as one; adds them to the store", run_merge);
  merge.add_option("--store", of_merge.sources.store,
                   "the store to add to (default: the one that the plan took constants from)");
  merge.add_flag("--verify", of_merge.verify, "also read every repaired file again");
  merge.add_flag("--dry-run", of_merge.dry_run, "add nothing to the store, write no manifest");
  auto [report, of_report] = add("report", "a page about the files and units", run_report);
  report.add_option("-o,--output", of_report.output, "the page (HTML)")->required();
  add_output_options(report, of_report.outputs);
  add("status", "how far the shards are", run_status);
}

}  // namespace sixpoint::cli
