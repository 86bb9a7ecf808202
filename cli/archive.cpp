// sixpoint archive plan|run|merge|status: an archive on a cluster, shard by shard
// (docs/archive.md).
#include <filesystem>

#include <fmt/format.h>

#include "base/sha256.h"
#include "repair/archive_merge.h"
#include "repair/archive_plan.h"
#include "repair/archive_run.h"
#include "repair/archive_scripts.h"
#include "station/cli/command.h"
#include "station/cli/repair_answer.h"
#include "station/cli/store_option.h"

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

struct PlanOptions {
  std::vector<std::string> paths;
  std::string folder;
  std::string constants;
  std::string store;
  std::string calibration_file;
  bool scan = false;
  bool dry_run = false;
  bool json = false;
  ArchiveDraft draft;
};

struct RunOptions {
  std::string plan;
  std::string output;
  std::size_t shard = 0;
  bool dry_run = false;
  bool json = false;
};

struct MergeOptions {
  std::string plan;
  std::string store;
  bool verify = false;
  bool dry_run = false;
  bool json = false;
};

struct StatusOptions {
  std::string plan;
  bool json = false;
};

// Tasks run in other folders. ".." stays: behind a link it is not what it looks like.
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

std::string this_program() {
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? "sixpoint" : program.string();
}

// A JSON document whose list of files may be longer than memory.
class FileStream {
 public:
  FileStream(Context& context, bool json) : context_(context), json_(json) {
    if (json_) {
      context_.out << "{\n\"schema\": \"sixpoint/archive/1\",\n\"files\": [";
    }
  }
  void add(const Json& file) {
    if (json_) {
      context_.out << (first_ ? "\n" : ",\n")
                   << file.dump(-1, ' ', false, Json::error_handler_t::replace);
      first_ = false;
    }
  }
  void add(const RepairReport& report) {
    if (json_) {
      add(report.to_json());
    } else {
      print_report(context_, report);
    }
  }
  // The other keys of the document.
  void end(const Json& rest) {
    if (!json_) {
      return;
    }
    context_.out << "\n]";
    for (const auto& [key, value] : rest.items()) {
      context_.out << ",\n\"" << key
                   << "\": " << value.dump(-1, ' ', false, Json::error_handler_t::replace);
    }
    context_.out << "\n}\n";
  }

 private:
  Context& context_;
  bool json_;
  bool first_ = true;
};

// --- plan

Status gather_constants(PlanOptions& options, Context& context,
                        std::optional<repair::ConstantsSnapshot>& snapshot) {
  ArchiveDraft& draft = options.draft;
  if (!options.constants.empty()) {
    SIXPOINT_ASSIGN(draft.repair.given, read_constants(context.env.files, options.constants));
  }
  // The same choice as repair's.
  const bool only_scan = options.scan && options.store.empty() && options.calibration_file.empty();
  if (!options.store.empty() || (!only_scan && store_exists(context, ""))) {
    SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
    SIXPOINT_ASSIGN(snapshot, repair::ConstantsSnapshot::of_store(store));
    const std::string place = store.database().location();
    draft.store = place.find("://") == std::string::npos ? absolute(place) : place;
    draft.snapshot = &*snapshot;
  }
  if (!options.calibration_file.empty()) {
    const std::string path = absolute(options.calibration_file);
    SIXPOINT_ASSIGN(std::string digest, file_sha256(context.env.files, path));
    draft.repair.calibration_file = {path, std::move(digest)};
  }
  return {};
}

void say_plan(const PlanOptions& options, const PlannedArchive& planned, Context& context) {
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
  const std::string folder = repair::shell_word(options.folder);
  context.people << fmt::format(
      "with Slurm:     sbatch {0}/run.sbatch OUTDIR, then sixpoint archive merge {0}\n"
      "on one machine: bash {0}/run_all.sh OUTDIR\n",
      folder);
}

void run_plan(PlanOptions& options, Context& context) {
  std::optional<repair::ConstantsSnapshot> snapshot;
  if (const Status gathered = gather_constants(options, context, snapshot); !gathered) {
    return report_error(context, "archive", gathered.error(), options.json);
  }
  ArchiveDraft& draft = options.draft;
  for (const std::string& path : options.paths) {
    draft.paths.push_back(absolute(path));
  }
  draft.software = software_and_build();
  draft.program = this_program();
  std::optional<Progress> progress;
  draft.progress = [&](std::size_t done, std::size_t files) {
    if (!progress) {
      progress.emplace(context, "hashing", files);
    }
    progress->at(done);
  };
  auto planned = repair::plan_archive(context.env, draft);
  progress.reset();
  if (!planned) {
    return report_error(context, "archive", planned.error(), options.json);
  }
  if (!options.dry_run) {
    const Status written =
        repair::write_plan(context.env, absolute(options.folder), draft, *planned);
    if (!written) {
      return report_error(context, "archive", written.error(), options.json);
    }
  }
  const ArchivePlan& plan = planned->plan;
  for (std::size_t i = 0; i < planned->not_followed.size(); ++i) {
    if (i == kLinksShown) {
      context.log().warn("... and {} links more", planned->not_followed.size() - i);
      break;
    }
    context.log().warn("{}: this link leads out of the tree and is not followed",
                       printable(planned->not_followed[i]));
  }
  if (plan.shards.size() > repair::kUsualMostShards) {
    context.log().warn("{} shards: Slurm's MaxArraySize is 1001 unless your cluster says otherwise",
                       plan.shards.size());
  }
  FileStream files(context, options.json);
  for (const repair::RefusedPath& refused : plan.refused) {
    files.add(failed_report(refused.path, refused.error));
    context.worsen(static_cast<int>(refused.error.code));
  }
  if (!options.json) {
    return say_plan(options, *planned, context);
  }
  Json shards = Json::array();
  std::size_t at = 0;
  for (std::size_t k = 0; k < plan.shards.size(); ++k) {
    for (std::size_t i = 0; i < plan.shards[k].files; ++i, ++at) {
      const repair::ArchiveFile& file = planned->files[at];
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
               {"links_not_followed", planned->not_followed.size()},
               {"dry_run", options.dry_run}}},
             {"plan", plan.id.empty() ? Json(nullptr) : Json(plan.id)}});
}

// --- run

void run_shard(const RunOptions& options, Context& context) {
  const std::string folder = absolute(options.plan);
  const auto plan = repair::read_plan(context.env.files, folder);
  if (!plan) {
    return report_error(context, "archive", plan.error(), options.json);
  }
  repair::ShardRunOptions how;
  how.shard = options.shard;
  how.output_folder = absolute(options.output);
  how.dry_run = options.dry_run;
  how.software = software_and_build();
  std::optional<Progress> progress;
  how.progress = [&](std::size_t done, std::size_t files) {
    if (!progress) {
      progress.emplace(context, fmt::format("shard {}", options.shard), files);
    }
    progress->at(done);
  };
  const auto result = repair::run_shard(context.env, folder, *plan, how);
  progress.reset();
  if (!result) {
    return report_error(context, "archive", result.error(), options.json);
  }
  RepairTally tally;
  FileStream files(context, options.json);
  for (const RepairReport& report : result->files) {
    context.worsen(exit_code_of(report));
    tally.add(report);
    files.add(report);
  }
  files.end({{"shards",
              {{{"shard", options.shard},
                {"state", repair::to_string(options.dry_run ? repair::ShardState::missing
                                                            : repair::ShardState::done)},
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
}

// --- merge

// How a shard that is not done, or in which files failed, is run again.
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

Json to_json(const MergedShard& shard, const Rerun& rerun) {
  return {{"shard", shard.shard},
          {"state", repair::to_string(shard.state)},
          {"files", shard.files},
          {"files_done", shard.files_done},
          {"failed", shard.failed},
          {"rerun", wants_rerun(shard) ? Json(rerun.shard(shard.shard)) : Json(nullptr)}};
}

Json shards_to_json(const MergedArchive& merged, const Rerun& rerun) {
  Json shards = Json::array();
  for (const MergedShard& shard : merged.shards) {
    shards.push_back(to_json(shard, rerun));
  }
  return shards;
}

void say_what_is_missing(const MergedArchive& merged, const Rerun& rerun, Context& context) {
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

void run_merge(const MergeOptions& options, Context& context) {
  const std::string folder = absolute(options.plan);
  const auto plan = repair::read_plan(context.env.files, folder);
  if (!plan) {
    return report_error(context, "archive", plan.error(), options.json);
  }
  // The store that the constants came from, unless another one is named.
  const std::string location = options.store.empty() ? plan->store : options.store;
  std::optional<Result<db::Store>> store;
  if (!location.empty() && !options.dry_run) {
    store = open_existing_store(context, location);
    if (!*store) {
      return report_error(context, "archive", store->error(), options.json);
    }
  }
  RepairTally tally;
  FileStream files(context, options.json);
  for (const repair::RefusedPath& refused : plan->refused) {
    const RepairReport report = failed_report(refused.path, refused.error);
    context.worsen(exit_code_of(report));
    tally.add(report);
    files.add(report);
  }
  Json kept_json(nullptr);
  const auto keep = [&](const ShardResult& result) {
    if (!store) {
      return;
    }
    const auto kept = keep_repairs(context, location, *store, result.files, result.software);
    if (!kept) {
      context.log().error("shard {}: the store does not know of its files: {}; merge again",
                          result.shard, kept.error().brief());
      context.worsen(static_cast<int>(kept.error().code));
      kept_json = {{"in", nullptr}, {"error", error_to_json(kept.error())}};
    } else if (*kept && (kept_json.is_null() || !(*kept)->in_store())) {
      kept_json = kept_to_json(**kept);
    }
  };
  std::optional<Progress> progress;
  progress.emplace(context, "merging", plan->shards.size());
  repair::MergeOptions how;
  how.verify = options.verify;
  how.visit = [&](const ShardResult& result) -> Status {
    for (const RepairReport& report : result.files) {
      context.worsen(exit_code_of(report));
      tally.add(report);
      files.add(report);
    }
    keep(result);
    progress->at(result.shard);
    return {};
  };
  const auto merged = repair::merge_archive(context.env.files, folder, *plan, how);
  progress.reset();
  if (!merged) {  // nothing that a visit answers; said all the same
    context.log().error(merged.error().brief());
    context.worsen(static_cast<int>(merged.error().code));
    return;
  }
  if (!merged->complete()) {
    context.worsen(kExitInconclusive);
  }
  const Rerun rerun(context.env.files, options.plan);
  files.end({{"shards", shards_to_json(*merged, rerun)},
             {"summary", tally.to_json(false)},
             {"complete", merged->complete()},
             {"files_missing", merged->files_missing()},
             {"kept", kept_json}});
  if (!options.json) {
    context.people << tally.brief(false);
    if (!merged->complete()) {
      context.people << fmt::format("not complete: nothing is known of {} files yet\n",
                                    merged->files_missing());
    }
    say_what_is_missing(*merged, rerun, context);
  }
}

// --- status

void run_status(const StatusOptions& options, Context& context) {
  const std::string folder = absolute(options.plan);
  const auto plan = repair::read_plan(context.env.files, folder);
  if (!plan) {
    return report_error(context, "archive", plan.error(), options.json);
  }
  std::vector<RepairReport> failed;
  repair::MergeOptions how;
  how.visit = [&](const ShardResult& result) -> Status {
    for (const RepairReport& report : result.files) {
      if (report.status == repair::RepairStatus::failed) {
        failed.push_back(report);
      }
    }
    return {};
  };
  auto merged = repair::merge_archive(context.env.files, folder, *plan, how);
  if (!merged) {
    return report_error(context, "archive", merged.error(), options.json);
  }
  // A finished shard may be under way once more, for its files that failed.
  for (MergedShard& shard : merged->shards) {
    if (shard.complete() && shard.failed > 0) {
      const auto standing = repair::standing_of(context.env.files, folder, *plan, shard.shard);
      shard.state = standing.state;
    }
  }
  std::map<repair::ShardState, std::size_t> counts;
  std::size_t files_done = 0;
  for (const MergedShard& shard : merged->shards) {
    ++counts[shard.state];
    files_done += shard.files_done;
  }
  if (!merged->complete()) {
    context.worsen(kExitInconclusive);
  }
  const Rerun rerun(context.env.files, options.plan);
  Json summary = {{"files", plan->files()},
                  {"files_done", files_done},
                  {"failed", failed.size()},
                  {"refused", plan->refused.size()},
                  {"shards", plan->shards.size()}};
  for (const auto state :
       {repair::ShardState::done, repair::ShardState::running, repair::ShardState::partly,
        repair::ShardState::missing, repair::ShardState::damaged}) {
    summary[std::string(repair::to_string(state))] = counts[state];
  }
  FileStream files(context, options.json);
  if (options.json) {
    for (const RepairReport& report : failed) {
      files.add(report);
    }
  }
  files.end({{"shards", shards_to_json(*merged, rerun)}, {"summary", summary}});
  if (!options.json) {
    for (const MergedShard& shard : merged->shards) {
      context.out << fmt::format("shard {:05}  {:<8} {} of {} files", shard.shard,
                                 repair::to_string(shard.state), shard.files_done, shard.files)
                  << (shard.failed > 0 ? fmt::format(", {} failed", shard.failed) : "") << '\n';
    }
    context.people << fmt::format("{} of {} shards, {} of {} files done\n",
                                  counts[repair::ShardState::done], plan->shards.size(), files_done,
                                  plan->files());
  }
}

void add_plan(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("plan", "Write down what is mended, in how many shards");
  auto options = std::make_shared<PlanOptions>();
  command->add_option("path", options->paths, "Recordings (.gt3x) or folders of them")->required();
  command->add_option("-o,--output", options->folder, "The folder for the plan")->required();
  auto* shards = command->add_option("--shards", options->draft.shards, "How many shards")
                     ->check(CLI::Range(std::size_t{1}, repair::kMostShards));
  command
      ->add_option("--shard-bytes", options->draft.shard_bytes,
                   "What a shard holds at most, such as 500MB (default: 4GB, 1000 shards at most)")
      ->transform(CLI::AsSizeValue(false))
      ->excludes(shards);
  command->add_option("--at-once", options->draft.at_once,
                      "Tasks of the Slurm array at a time (default: 64; 0: no limit)");
  command->add_flag("--hash", options->draft.hash,
                    "Know files by SHA-256, not by size and time of change: reads all of them");
  command->add_option("--constants", options->constants, "Use these constants (constants.json)");
  add_store_option(*command, options->store);
  command->add_option("--calibration-file", options->calibration_file,
                      "A recording of the unit lying still on each of its six sides");
  command->add_flag("--scan", options->scan,
                    "Use the still periods of the file itself (also the last resort without it)");
  repair::RepairOptions& how = options->draft.repair.options;
  command->add_flag("--wide", how.wide,
                    "Write 16-bit records (ACTIVITY2), in which nothing needs clipping");
  command->add_flag("--undo-rotation", how.undo_rotation,
                    "Also turn back the axes of firmware 1.6.0 where the constants are right");
  command->add_flag("--allow-prior", how.allow_prior,
                    "Also use constants that rest on a population prior");
  command->add_flag("--dry-run", options->dry_run, "Say what would be planned, write nothing");
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run_plan(*options, context); });
}

void add_run(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("run", "Mend one shard; again as often as you like");
  auto options = std::make_shared<RunOptions>();
  command->add_option("plan", options->plan, "The folder of the plan")->required();
  command->add_option("--shard", options->shard, "Which one, counted from 0")->required();
  command->add_option("-o,--output", options->output, "The folder for mended files")->required();
  command->add_flag("--dry-run", options->dry_run, "Compute everything, write nothing");
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run_shard(*options, context); });
}

void add_merge(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("merge", "The answers of all shards as one; tells the store");
  auto options = std::make_shared<MergeOptions>();
  command->add_option("plan", options->plan, "The folder of the plan")->required();
  command->add_option(
      "--store", options->store,
      "The store that is told (default: the one that the plan took constants from)");
  command->add_flag("--verify", options->verify, "Also read every mended file again");
  command->add_flag("--dry-run", options->dry_run, "Tell the store nothing");
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run_merge(*options, context); });
}

void add_status(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("status", "How far the shards are");
  auto options = std::make_shared<StatusOptions>();
  command->add_option("plan", options->plan, "The folder of the plan")->required();
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run_status(*options, context); });
}

}  // namespace

void add_archive(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("archive", "Mend an archive on a cluster, shard by shard");
  command->require_subcommand(1);
  add_plan(*command, context);
  add_run(*command, context);
  add_merge(*command, context);
  add_status(*command, context);
}

}  // namespace sixpoint::cli
