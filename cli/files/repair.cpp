// sixpoint repair PATH... -o OUTDIR: repairs affected files; the originals stay as they are.
#include <atomic>

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/files/manifest.h"
#include "cli/files/repair_answer.h"
#include "cli/files/salvage_option.h"
#include "cli/output.h"
#include "cli/stop_request.h"
#include "cli/store_option.h"
#include "cli/workers.h"
#include "repair/archive/archive_scripts.h"
#include "repair/batch/repair_files.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/repair_file.h"

namespace sixpoint::cli {
namespace {

using repair::RepairReport;

struct Options {
  std::vector<std::string> paths;
  std::string folder;
  RepairSources sources;
  repair::RepairOptions repair;
  unsigned jobs = 0;
  bool json = false;
};

Result<repair::ConstantsFinderOptions> finder_options(const Options& options, Context& context,
                                                      std::optional<db::Store>& store) {
  const RepairSources& sources = options.sources;
  repair::ConstantsFinderOptions finder;
  finder.still = options.repair.still;
  finder.scan = sources.scan;
  finder.or_scan = sources.or_scan;
  finder.store_named = !sources.store.empty();
  finder.allow_prior = options.repair.allow_prior;
  if (!sources.constants.empty()) {
    SIXPOINT_ASSIGN(finder.given, read_constants(context.env.files, sources.constants));
  }
  SIXPOINT_ASSIGN(store, store_of(context, sources));
  finder.store = store ? &*store : nullptr;
  if (!sources.calibration_file.empty()) {
    SIXPOINT_CHECK(context.env.files.info(sources.calibration_file));
    finder.calibration_file = sources.calibration_file;
  }
  return finder;
}

// Every file's report, but for those that were not begun when the operator stopped the run.
std::vector<RepairReport> repair_all(const std::vector<NamedFile>& files, const Options& options,
                                     repair::ConstantsFinder& finder, Context& context) {
  StopRequest stop;
  std::atomic<bool> stopping{false};
  Progress progress(context, "repairing", files.size());
  const auto watch = [&](std::size_t done) {
    progress.at(done);
    stopping = stop.requested();
  };
  return repair::repair_files(context.env, files, {options.folder, options.repair, options.jobs},
                              finder, watch, &stopping);
}

// The command line that goes on with this run.
std::string line_that_goes_on(const Options& options) {
  std::string line = "sixpoint repair";
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) {
      line += fmt::format(" {} {}", name, repair::shell_word(value));
    }
  };
  const auto flag = [&](const char* name, bool given) { line += given ? name : ""; };
  for (const std::string& path : options.paths) {
    line += fmt::format(" {}", repair::shell_word(path));
  }
  add("-o", options.folder);
  add("--constants", options.sources.constants);
  add("--calibration-file", options.sources.calibration_file);
  add("--store", options.sources.store);
  flag(" --scan", options.sources.scan);
  flag(" --or-scan", options.sources.or_scan);
  flag(" --wide", options.repair.wide);
  flag(" --store-only", options.repair.store_only);
  flag(" --undo-rotation", options.repair.undo_rotation);
  flag(" --allow-prior", options.repair.allow_prior);
  flag(" --salvage", options.repair.salvage);
  flag(" --force", options.repair.force);
  flag(" --redo-outdated", options.repair.redo_outdated);
  return line + " --resume";
}

// What the run leaves in its folder, and how it goes on where it was stopped.
Status conclude(const Options& options, const std::vector<RepairReport>& reports, std::size_t files,
                Context& context) {
  const bool stopped = reports.size() < files;
  if (stopped) {
    context.worsen(kExitStopped);
  }
  if (!options.repair.dry_run && context.env.files.info(options.folder)) {
    SIXPOINT_CHECK(
        write_manifest(context.env.files, options.folder, reports, context.env.clock.now()));
  }
  if (stopped) {
    context.people << fmt::format("stopped: {} of {} files are done; to go on:\n  {}\n",
                                  reports.size(), files, line_that_goes_on(options));
  }
  return {};
}

Status run(const Options& options, Context& context) {
  Outputs outputs(context, {}, options.json);
  SIXPOINT_CHECK(outputs.working_folder("--output", options.folder));
  SIXPOINT_CHECK(check_manifest(context.env.files, options.folder));
  std::optional<db::Store> store;
  SIXPOINT_ASSIGN(auto how, finder_options(options, context, store));
  repair::ConstantsFinder finder(context.env, std::move(how));

  auto files = named_files(context, options.paths, {".gt3x"});
  repair::refuse_same_outputs(files, options.folder);
  const auto reports = repair_all(files, options, finder, context);
  RepairTally tally;
  Json json = document("repair");
  Json& list = json["files"] = Json::array();
  for (const RepairReport& report : reports) {
    tally.add(context, report);
    list.push_back(report.to_json());
  }
  json["summary"] = tally.to_json(options.repair.dry_run);
  json["kept"] = nullptr;
  if (store) {
    Result<db::Store> opened = *std::move(store);
    json["kept"] =
        keep_repairs(context, options.sources.store, opened, reports, "run it again with --resume");
  }
  if (options.json) {
    SIXPOINT_CHECK(print_json(context, json));
  } else {
    for (const RepairReport& report : reports) {
      print_report(context, report);
    }
    context.people << tally.brief(options.repair.dry_run);
  }
  return conclude(options, reports, files.size(), context);
}

}  // namespace

void add_repair(CLI::App& app, Context& context) {
  auto [command, options] = add_command<Options>(app, context, "repair",
                                                 "repair affected files into another folder", run);
  command.add_option("path", options.paths, "recordings (.gt3x) or folders of them")->required();
  command.add_option("-o,--output", options.folder, "the folder for repaired files")->required();
  add_source_options(command, options.sources);
  add_repair_options(command, options.repair);
  command.add_flag("--dry-run", options.repair.dry_run, "compute everything, write nothing");
  command.add_flag("--resume", options.repair.resume,
                   "go on with an earlier run: what it finished is left as it is");
  add_redo_option(command, options.repair.redo_outdated);
  add_salvage_option(command, options.repair.salvage);
  add_jobs_option(command, options.jobs);
}

}  // namespace sixpoint::cli
