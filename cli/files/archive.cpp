// sixpoint archive plan|run|merge|status: an archive on a cluster, shard by shard
// (docs/archive.md).
#include <filesystem>

#include <fmt/format.h>

#include "base/sha256.h"
#include "cli/command.h"
#include "cli/files/file_stream.h"
#include "cli/files/manifest.h"
#include "cli/files/repair_answer.h"
#include "cli/output.h"
#include "cli/stop_request.h"
#include "cli/store_option.h"
#include "cli/workers.h"
#include "repair/archive/archive_merge.h"
#include "repair/archive/archive_plan.h"
#include "repair/archive/archive_run.h"
#include "repair/archive/archive_scripts.h"
#include "repair/archive/plan_folder.h"
#include "station/records/software.h"

namespace sixpoint::cli {
namespace {

using repair::ArchiveDraft;
using repair::ArchivePlan;
using repair::MergedArchive;
using repair::MergedShard;
using repair::PlannedArchive;
using repair::RepairReport;
using repair::ShardResult;

constexpr std::size_t kLinksShown = 10;

// Of all subcommands, because only one of them runs.
struct Options {
  std::vector<std::string> paths;
  std::string plan;    // the folder of the plan
  std::string output;  // plan: its folder; run: the folder for repaired files
  RepairSources sources;
  ArchiveDraft draft;  // as far as the options describe it
  std::size_t shard = 0;
  unsigned jobs = 0;
  bool verify = false;
  bool redo_outdated = false;
  bool dry_run = false;
  bool json = false;
};

// Tasks run in other folders. ".." stays: after a link it leads elsewhere than the path says.
std::string absolute(const std::string& path) {
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(path, error);
  if (error) {
    return path;
  }
  const bool climbs = std::find(whole.begin(), whole.end(), "..") != whole.end();
  std::string text = (climbs ? whole : whole.lexically_normal()).string();
  while (text.size() > 1 && text.ends_with('/')) {
    text.pop_back();
  }
  return text;
}

// A progress bar that appears with the library's first call.
std::function<void(std::size_t, std::size_t)> show_in(std::optional<Progress>& progress,
                                                      Context& context, std::string doing) {
  return [&progress, &context, doing = std::move(doing)](std::size_t done, std::size_t files) {
    if (!progress) {
      progress.emplace(context, doing, files);
    }
    progress->at(done);
  };
}

// --- plan

Status gather_constants(const RepairSources& sources, Context& context, ArchiveDraft& draft,
                        std::optional<repair::ConstantsSnapshot>& snapshot) {
  if (!sources.constants.empty()) {
    SIXPOINT_ASSIGN(draft.repair.given, read_constants(context.env.files, sources.constants));
  }
  draft.repair.scan = sources.scan;
  draft.repair.or_scan = sources.or_scan;
  draft.repair.no_pool = sources.no_pool;
  draft.repair.store_named = !sources.store.empty();
  SIXPOINT_ASSIGN(auto store, store_of(context, sources));
  if (store) {
    const std::string place = store->database().location();
    draft.store = place.find("://") == std::string::npos ? absolute(place) : place;
    const auto order = order_of(sources, true);
    if (std::ranges::find(order, repair::SourceKind::store) != order.end()) {
      SIXPOINT_ASSIGN(snapshot, repair::ConstantsSnapshot::of_store(*store));
      draft.snapshot = &*snapshot;
    }
  }
  if (!sources.calibration_file.empty()) {
    const std::string path = absolute(sources.calibration_file);
    SIXPOINT_ASSIGN(std::string digest, file_sha256(context.env.files, path));
    draft.repair.calibration_file = {path, std::move(digest)};
  }
  return {};
}

void print_plan(const Options& options, const PlannedArchive& planned, Context& context) {
  const ArchivePlan& plan = planned.plan;
  for (std::size_t k = 0; k < plan.shards.size(); ++k) {
    context.out << fmt::format("shard {:05}  {} files  {:.1f} MB\n", k, plan.shards[k].files,
                               static_cast<double>(plan.shards[k].bytes) / 1e6);
  }
  context.people << fmt::format("{} files, {:.1f} MB, in {} shards\n", plan.files(),
                                static_cast<double>(plan.bytes()) / 1e6, plan.shards.size());
  if (options.dry_run) {
    context.people << "dry run: nothing was written\n";
    return;
  }
  const std::string folder = repair::shell_word(options.output);
  context.people << fmt::format(
      "with Slurm:     sbatch {0}/run.sbatch OUTDIR, then sixpoint archive merge {0}\n"
      "on one machine: bash {0}/run_all.sh OUTDIR\n",
      folder);
}

void warn_about_plan(const PlannedArchive& planned, Context& context) {
  for (std::size_t i = 0; i < planned.not_followed.size(); ++i) {
    if (i == kLinksShown) {
      context.log().warn("... and {} links more", planned.not_followed.size() - i);
      break;
    }
    context.log().warn("{}: this link leads out of the tree and is not followed",
                       printable(planned.not_followed[i]));
  }
  const std::size_t shards = planned.plan.shards.size();
  if (shards > repair::kUsualMostShards) {
    context.log().warn("{} shards: Slurm's MaxArraySize is 1001 unless your cluster says otherwise",
                       shards);
  }
}

void end_json_of_plan(const PlannedArchive& planned, bool dry_run, FileStream& files) {
  const ArchivePlan& plan = planned.plan;
  Json shards = Json::array();
  std::size_t at = 0;
  for (std::size_t k = 0; k < plan.shards.size(); ++k) {
    for (std::size_t i = 0; i < plan.shards[k].files; ++i, ++at) {
      const repair::ArchiveFile& file = planned.files[at];
      files.add(Json{{"input", plan.input_of(file)},
                     {"status", "planned"},
                     {"shard", k},
                     {"bytes", file.size}});
    }
    shards.push_back({{"shard", k},
                      {"state", repair::to_string(repair::ShardState::missing)},
                      {"files", plan.shards[k].files},
                      {"bytes", plan.shards[k].bytes}});
  }
  files.end({{"shards", shards},
             {"summary",
              {{"files", plan.files()},
               {"bytes", plan.bytes()},
               {"shards", plan.shards.size()},
               {"refused", plan.refused.size()},
               {"links_not_followed", planned.not_followed.size()},
               {"dry_run", dry_run}}},
             {"plan", text_or_null(plan.id)}});
}

// The folder of a plan is new. One that a killed program left half made is gone on with.
Status take_plan_folder(const std::string& folder, FileSystem& files, Outputs& outputs) {
  return files.info(folder + "/plan.lock") ? outputs.working_folder("--output", folder)
                                           : outputs.folder("--output", folder);
}

// The still periods of the units' files together: one pass over the affected files.
void ask_units(const Options& options, const ArchiveDraft& draft, Context& context,
               PlannedArchive& planned) {
  if (!repair::asks_units(planned.plan.repair, draft.snapshot != nullptr)) {
    return;
  }
  repair::ask_units(
      context.env, draft.snapshot,
      [&](std::size_t count, const std::function<void(std::size_t)>& work) {
        Progress progress(context, "reading still periods", count);
        for_each_job(count, options.jobs, work, [&](std::size_t done) { progress.at(done); });
      },
      planned);
}

Status run_plan(const Options& options, Context& context) {
  // --force is about files that repair refuses; a plan's folder is new in any case.
  Outputs outputs(context, {}, options.json);
  if (!options.dry_run) {
    SIXPOINT_CHECK(take_plan_folder(absolute(options.output), context.env.files, outputs));
  }
  ArchiveDraft draft = options.draft;
  std::optional<repair::ConstantsSnapshot> snapshot;
  SIXPOINT_CHECK(gather_constants(options.sources, context, draft, snapshot));
  for (const std::string& path : options.paths) {
    draft.paths.push_back(absolute(path));
  }
  draft.software = station::software_and_build();
  draft.program = this_program();
  std::optional<Progress> progress;
  draft.progress = show_in(progress, context, "hashing");
  auto planned = repair::plan_archive(context.env, draft);
  progress.reset();
  if (!planned) {
    return fail(planned.error());
  }
  ask_units(options, draft, context, *planned);
  if (!options.dry_run) {
    SIXPOINT_CHECK(repair::write_plan(context.env, absolute(options.output), draft, *planned));
  }
  warn_about_plan(*planned, context);
  FileStream files(context, options.json);
  for (const repair::RefusedPath& refused : planned->plan.refused) {
    files.add(failed_report(refused.path, refused.error));
    context.worsen(refused.error.code);
  }
  if (options.json) {
    end_json_of_plan(*planned, options.dry_run, files);
  } else {
    print_plan(options, *planned, context);
  }
  return {};
}

// --- run

repair::ShardState state_of(const Options& options, const ShardResult& result) {
  if (options.dry_run) {
    return repair::ShardState::missing;
  }
  return result.stopped ? repair::ShardState::partly : repair::ShardState::done;
}

Status run_shard(const Options& options, Context& context) {
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
  StopRequest stop;
  how.stop = [&stop] { return stop.requested(); };
  how.software = station::software_and_build();
  how.progress = show_in(progress, context, fmt::format("shard {}", options.shard));
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
        "stopped: {} files of the shard are done; to go on:\n  sixpoint archive run {} --shard {} "
        "-o {}{}\n",
        result->files.size(), repair::shell_word(options.plan), options.shard,
        repair::shell_word(options.output), options.redo_outdated ? " --redo-outdated" : "");
  }
  return {};
}

// --- merge

// The commands that run shards again: those that are not done, and those in which files failed.
class Rerun {
 public:
  Rerun(FileSystem& files, std::string plan) : plan_(std::move(plan)) {
    const auto output = repair::output_folder_of(files, absolute(plan_));
    output_ = output && *output ? repair::shell_word(**output) : "OUTDIR";
  }
  std::string shard(std::size_t number) const {
    return fmt::format("sixpoint archive run {} --shard {} -o {}", repair::shell_word(plan_),
                       number, output_);
  }
  std::string array(const std::vector<std::size_t>& shards) const {
    return fmt::format("sbatch --array={} {}/run.sbatch {}", fmt::join(shards, ","),
                       repair::shell_word(plan_), output_);
  }

 private:
  std::string plan_;
  std::string output_;
};

bool wants_rerun(const MergedShard& shard) { return !shard.complete() || shard.failed > 0; }

Json shards_to_json(const MergedArchive& merged, const Rerun& rerun) {
  Json shards = Json::array();
  for (const MergedShard& shard : merged.shards) {
    shards.push_back(
        {{"shard", shard.shard},
         {"state", repair::to_string(shard.state)},
         {"files", shard.files},
         {"files_done", shard.files_done},
         {"failed", shard.failed},
         {"rerun", wants_rerun(shard) ? Json(rerun.shard(shard.shard)) : Json(nullptr)}});
  }
  return shards;
}

void print_missing(const MergedArchive& merged, const Rerun& rerun, Context& context) {
  std::vector<std::size_t> again;
  for (const MergedShard& shard : merged.shards) {
    if (!wants_rerun(shard)) {
      continue;
    }
    again.push_back(shard.shard);
    context.people << (shard.complete()
                           ? fmt::format(
                                 "shard {}: {} of its {} files failed; try them again: {}\n",
                                 shard.shard, shard.failed, shard.files, rerun.shard(shard.shard))
                           : fmt::format("shard {} is {} ({} of {} files): {}\n", shard.shard,
                                         repair::to_string(shard.state), shard.files_done,
                                         shard.files, rerun.shard(shard.shard)));
  }
  if (again.size() > 1) {
    context.people << fmt::format("or all of them: {}\n", rerun.array(again));
  }
}

Status run_merge(const Options& options, Context& context) {
  const std::string folder = absolute(options.plan);
  SIXPOINT_ASSIGN(const auto plan, repair::read_plan(context.env.files, folder));
  // The store that is named, else the one that the constants came from.
  const std::string location = options.sources.store.empty() ? plan.store : options.sources.store;
  std::optional<Result<db::Store>> store;
  if (!location.empty() && !options.dry_run) {
    SIXPOINT_ASSIGN(auto opened, open_existing_store(context, location));
    store.emplace(std::move(opened));
  }
  // The manifest of the whole archive. Tasks that run at the same time leave none: each would
  // write over those of the others.
  std::optional<std::string> manifest_folder;
  if (!options.dry_run) {
    SIXPOINT_ASSIGN(manifest_folder, repair::output_folder_of(context.env.files, folder));
  }
  if (manifest_folder) {
    SIXPOINT_CHECK(check_manifest(context.env.files, *manifest_folder));
  }
  RepairTally tally;
  std::vector<RepairReport> reports;
  FileStream files(context, options.json);
  const auto add = [&](const RepairReport& report) {
    tally.add(context, report);
    files.add(report);
    if (manifest_folder) {
      reports.push_back(report);
    }
  };
  for (const repair::RefusedPath& refused : plan.refused) {
    add(failed_report(refused.path, refused.error));
  }
  Json kept(nullptr);
  std::optional<Progress> progress(std::in_place, context, "merging", plan.shards.size());
  repair::MergeOptions how;
  how.verify = options.verify;
  how.visit = [&](const ShardResult& result) -> Status {
    std::for_each(result.files.begin(), result.files.end(), add);
    if (store) {
      Json kept_now =
          keep_repairs(context, location, *store, result.files,
                       fmt::format("merge again (shard {})", result.shard), result.software);
      // A shard that is not in the store is the more important one to report.
      if (kept.is_null() || (!kept_now.is_null() && kept_now["in"] != "store")) {
        kept = std::move(kept_now);
      }
    }
    progress->at(result.shard);
    return {};
  };
  const auto merged = repair::merge_archive(context.env.files, folder, plan, how);
  progress.reset();
  if (!merged) {  // the JSON document was begun: no second one
    report_error(context, merged.error());
    return {};
  }
  context.worsen(merged->complete() ? kExitPassed : kExitInconclusive);
  if (manifest_folder) {
    if (const auto status =
            write_manifest(context.env.files, *manifest_folder, reports, context.env.clock.now());
        !status) {
      report_error(context, status.error());
    }
  }
  const Rerun rerun(context.env.files, options.plan);
  files.end({{"shards", shards_to_json(*merged, rerun)},
             {"summary", tally.to_json(false)},
             {"complete", merged->complete()},
             {"files_missing", merged->files_missing()},
             {"kept", kept}});
  if (!options.json) {
    context.people << tally.brief(false);
    if (!merged->complete()) {
      context.people << fmt::format("not complete: nothing is known of {} files yet\n",
                                    merged->files_missing());
    }
    print_missing(*merged, rerun, context);
  }
  return {};
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

Status run_status(const Options& options, Context& context) {
  const std::string folder = absolute(options.plan);
  SIXPOINT_ASSIGN(const auto plan, repair::read_plan(context.env.files, folder));
  std::vector<RepairReport> failed;
  SIXPOINT_ASSIGN(const auto merged, standing(context.env.files, folder, plan, failed));
  context.worsen(merged.complete() ? kExitPassed : kExitInconclusive);
  std::map<repair::ShardState, std::size_t> counts;
  std::size_t files_done = 0;
  std::string text;
  for (const MergedShard& shard : merged.shards) {
    ++counts[shard.state];
    files_done += shard.files_done;
    text += fmt::format("shard {:05}  {:<8} {} of {} files{}\n", shard.shard,
                        repair::to_string(shard.state), shard.files_done, shard.files,
                        shard.failed > 0 ? fmt::format(", {} failed", shard.failed) : "");
  }
  if (!options.json) {
    context.out << text;
    context.people << fmt::format("{} of {} shards, {} of {} files done\n",
                                  counts[repair::ShardState::done], plan.shards.size(), files_done,
                                  plan.files());
    return {};
  }
  Json summary = {{"files", plan.files()},
                  {"files_done", files_done},
                  {"failed", failed.size()},
                  {"refused", plan.refused.size()},
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
  auto [plan, options] =
      add_command<Options>(group, context, "archive", "plan",
                           "write down what is repaired, in how many shards", run_plan);
  plan.add_option("path", options.paths, "recordings (.gt3x) or folders of them")->required();
  plan.add_option("-o,--output", options.output, "the folder for the plan")->required();
  auto* shards = plan.add_option("--shards", options.draft.shards, "how many shards")
                     ->check(CLI::Range(std::size_t{1}, repair::kMostShards));
  plan.add_option("--shard-bytes", options.draft.shard_bytes,
                  "what a shard holds at most, such as 500MB (default: 4GB, 1000 shards at most)")
      ->transform(CLI::AsSizeValue(false))
      ->excludes(shards);
  plan.add_option("--at-once", options.draft.at_once,
                  "tasks of the Slurm array at a time (default: 64; 0: no limit)");
  plan.add_flag("--hash", options.draft.hash,
                "know files by SHA-256, not by size and time of change: reads all of them");
  add_source_options(plan, options.sources);
  add_repair_options(plan, options.draft.repair.options);
  plan.add_flag("--dry-run", options.dry_run, "print what would be planned, write nothing");
  add_jobs_option(plan, options.jobs);
  const auto add = [&](const char* name, const char* about,
                       Status (*work)(const Options&, Context&)) {
    auto declared = add_command<Options>(group, context, "archive", name, about, work);
    declared.command.add_option("plan", declared.options.plan, "the folder of the plan")
        ->required();
    return declared;
  };
  auto [run, of_run] = add("run", "repair one shard; may be repeated", run_shard);
  run.add_option("--shard", of_run.shard, "which one, counted from 0")->required();
  run.add_option("-o,--output", of_run.output, "the folder for repaired files")->required();
  add_redo_option(run, of_run.redo_outdated);
  run.add_flag("--dry-run", of_run.dry_run, "compute everything, write nothing");
  auto [merge, of_merge] =
      add("merge", "the answers of all shards as one; adds them to the store", run_merge);
  merge.add_option("--store", of_merge.sources.store,
                   "the store to add to (default: the one that the plan took constants from)");
  merge.add_flag("--verify", of_merge.verify, "also read every repaired file again");
  merge.add_flag("--dry-run", of_merge.dry_run, "add nothing to the store, write no manifest");
  add("status", "how far the shards are", run_status);
}

}  // namespace sixpoint::cli
