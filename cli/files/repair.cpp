// sixpoint repair PATH... -o OUTDIR: repairs affected files; the originals stay as they are.
#include <atomic>
#include <optional>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/files/repair_answer.h"
#include "cli/files/salvage_option.h"
#include "cli/output.h"
#include "cli/people_text.h"
#include "cli/stop_request.h"
#include "cli/store_option.h"
#include "cli/workers.h"
#include "repair/archive/output_lock.h"
#include "repair/batch/manifest.h"
#include "repair/batch/repair_files.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/repair_file.h"
#include "repair/units/unit_pool.h"
#include "station/records/software.h"

namespace sixpoint::cli {
namespace {

using repair::RepairReport;
using repair::RepairStatus;

struct RepairCommandOptions {
  std::vector<std::string> paths;
  std::string folder;
  RepairSources sources;
  repair::RepairOptions repair;
  repair::LinkKind link = repair::LinkKind::none;
  bool report = false;
  unsigned jobs = 0;
  bool json = false;
};

Result<repair::ConstantsFinderOptions> finder_options(const RepairCommandOptions& options,
                                                      Context& context,
                                                      std::optional<db::Store>& store,
                                                      repair::UnitPool& pool) {
  const RepairSources& sources = options.sources;
  repair::ConstantsFinderOptions finder;
  finder.still = options.repair.still;
  finder.scan = sources.scan;
  finder.or_scan = sources.or_scan;
  finder.store_named = !sources.store.empty();
  finder.allow_prior = options.repair.allow_prior;
  finder.unit = sources.no_pool ? nullptr : &pool;
  if (!sources.constants.empty()) {
    SIXPOINT_ASSIGN(finder.given, read_constants(context.env.files, sources.constants));
  }
  SIXPOINT_ASSIGN(store, store_of(context, sources));
  finder.store = store ? &*store : nullptr;
  if (!sources.calibration_file.empty()) {
    SIXPOINT_CHECK(
        repair::check_calibration_recording(context.env.files, sources.calibration_file));
    finder.calibration_file = sources.calibration_file;
  }
  return finder;
}

// Every file's report, but for those that were not done when the operator stopped the run.
std::vector<RepairReport> repair_all(const std::vector<NamedFile>& files,
                                     const RepairCommandOptions& options,
                                     repair::ConstantsFinder& finder, repair::UnitPool& pool,
                                     StopRequest& stop, Context& context) {
  repair::RepairFilesOptions how;
  how.folder = options.folder;
  how.repair = options.repair;
  how.jobs = options.jobs;
  how.link = options.link;
  how.make_link = repair::link_file;
  std::atomic<bool> stopping{false};
  std::optional<Progress> progress;
  repair::RepairWatch watch;
  watch.begin = [&](const char* doing, std::size_t count) {
    progress.reset();  // takes its line away
    progress.emplace(context, doing, count);
  };
  watch.at = [&](const repair::RepairProgress& done) {
    progress->at(done.files, done.bytes, done.failed);
    stopping = stop.requested();
  };
  return repair::repair_files(context.env, files, how, finder, pool, watch, &stopping);
}

// The command line that goes on with this run.
std::string line_that_goes_on(const RepairCommandOptions& options, bool salvage) {
  std::string line = "sixpoint repair";
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) {
      line += fmt::format(" {} {}", name, bash_word(value));
    }
  };
  for (const std::string& path : options.paths) {
    line += fmt::format(" {}", bash_word(path_word(path)));
  }
  add("-o", options.folder);
  add("--constants", options.sources.constants);
  add("--calibration-file", options.sources.calibration_file);
  add("--store", options.sources.store);
  const RepairSources& from = options.sources;
  const repair::RepairOptions& how = options.repair;
  for (const auto& [flag, given] : {std::pair(" --scan", from.scan),
                                    {" --or-scan", from.or_scan},
                                    {" --no-pool", from.no_pool},
                                    {" --wide", how.wide},
                                    {" --store-only", how.store_only},
                                    {" --undo-rotation", how.undo_rotation},
                                    {" --allow-prior", how.allow_prior},
                                    {" --salvage", salvage},
                                    {" --force", how.force},
                                    {" --redo-outdated", how.redo_outdated},
                                    {" --report", options.report}}) {
    line += given ? flag : "";
  }
  if (options.link != repair::LinkKind::none) {
    add("--link-unaffected", std::string(to_string(options.link)));
  }
  return line + " --resume";
}

Status leave_in_folder(const RepairCommandOptions& options,
                       const std::vector<RepairReport>& reports,
                       const std::vector<repair::UnitNeeds>& units, Context& context) {
  FileSystem& disk = context.env.files;
  if (options.repair.dry_run || !disk.info(options.folder)) {
    return {};
  }
  SIXPOINT_CHECK(repair::write_manifest(disk, options.folder, reports, context.env.clock.now(),
                                        station::software_and_build()));
  SIXPOINT_CHECK(repair::write_units(disk, options.folder, units));
  return options.report ? write_study_report(context, disk, options.folder + "/report.html",
                                             "Repair into " + options.folder, reports)
                        : Status();
}

// True where files failed. A command only where it can do one of them (next_run()).
bool say_what_failed(const RepairCommandOptions& options, const std::vector<RepairReport>& reports,
                     Context& context) {
  std::size_t failed = 0;
  std::size_t helped = 0;
  bool salvage = options.repair.salvage;
  for (const RepairReport& report : reports) {
    if (report.status != RepairStatus::failed) {
      continue;
    }
    ++failed;
    const repair::NextRun next =
        repair::next_run(report.error.value_or(Error{}), options.repair.salvage);
    helped += next != repair::NextRun::none ? 1 : 0;
    salvage = salvage || next == repair::NextRun::with_salvage;
  }
  if (failed > 0 && helped == 0) {
    context.people << fmt::format(
        "next: {} of the files failed; do what their lines say: no run of this command repairs "
        "them\n",
        failed);
  } else if (failed > 0) {
    const std::string which =
        helped == failed ? "" : fmt::format("; another run can repair {} of them", helped);
    context.people << fmt::format(
        "next: {} of the files failed{}; do what their lines say, then go on:\n  {}\n", failed,
        which, line_that_goes_on(options, salvage));
  }
  return failed > 0;
}

// The command that comes next, or that goes on where this run was stopped.
void say_what_is_next(const RepairCommandOptions& options, const std::vector<RepairReport>& reports,
                      std::size_t files, Context& context) {
  if (reports.size() < files) {
    context.worsen(kExitStopped);
    context.people << fmt::format("stopped: {} of {} files are done; to go on:\n  {}\n",
                                  reports.size(), files,
                                  line_that_goes_on(options, options.repair.salvage));
    return;
  }
  if (say_what_failed(options, reports, context)) {
    return;  // impact refuses a pair that does not belong together
  }
  const auto asked = context.env.files.info(options.paths.front());
  if (options.paths.size() == 1 && asked && asked->is_folder && !options.repair.dry_run &&
      std::ranges::any_of(reports,
                          [](const RepairReport& report) { return !report.output.empty(); })) {
    next_step(context, options.json, {"impact", path_word(options.paths.front()), options.folder});
  }
}

Result<std::unique_ptr<FileLock>> lock_of(const RepairCommandOptions& options, Context& context) {
  if (options.repair.dry_run) {
    return nullptr;
  }
  SIXPOINT_ASSIGN(auto lock,
                  repair::lock_for_repair(context.env.files, options.folder, options.paths));
  if (lock == nullptr) {
    context.log().warn("{}: its file system has no locks; let no other run write here",
                       printable(options.folder));
  }
  return lock;
}

Status run_repair(const RepairCommandOptions& options, Context& context) {
  Outputs outputs(context, {}, options.json);
  SIXPOINT_CHECK(outputs.working_folder("--output", options.folder));
  SIXPOINT_CHECK(repair::check_manifest(context.env.files, options.folder));
  std::optional<db::Store> store;
  repair::UnitPool pool;
  SIXPOINT_ASSIGN(auto how, finder_options(options, context, store, pool));
  repair::ConstantsFinder finder(context.env, std::move(how));

  SIXPOINT_ASSIGN(const auto lock, lock_of(options, context));
  auto files = named_files(context, options.paths, {".gt3x"});
  repair::leave_out_outputs(context.env.files, files, options.folder);
  repair::refuse_same_outputs(files, options.folder);
  // Until the manifest is written: a signal that comes late may take the answer, never the record.
  std::optional<StopRequest> stop(std::in_place);
  const auto reports = repair_all(files, options, finder, pool, *stop, context);
  RepairTally tally;
  repair::UnitTable table(order_of(options.sources, store.has_value()));
  Json json = document("repair");
  Json& list = json["files"] = Json::array();
  for (const RepairReport& report : reports) {
    tally.add(context, report);
    table.add(report);
    list.push_back(report.to_json());
  }
  json["summary"] = tally.to_json(options.repair.dry_run);
  const auto units = table.rows();
  json["units"] = repair::units_json(units);
  json["kept"] = nullptr;
  if (store) {
    Result<db::Store> opened = *std::move(store);
    json["kept"] =
        keep_repairs(context, options.sources.store, opened, reports, "run it again with --resume");
  }
  const Status left = leave_in_folder(options, reports, units, context);
  stop.reset();
  if (options.json) {
    SIXPOINT_CHECK(print_json(context, json));
  } else {
    for (const RepairReport& report : reports) {
      print_report(context, report);
    }
    print_units(context, units);
    context.people << tally.brief(options.repair.dry_run);
  }
  // Behind the answer, and by itself: returned, it would become a second document.
  if (!left) {
    report_error(context, left.error());
  }
  say_what_is_next(options, reports, files.size(), context);
  return {};
}

}  // namespace

void add_repair(CLI::App& app, Context& context) {
  auto [command, options] = add_command<RepairCommandOptions>(
      app, context, "repair", "repair affected files into another folder", run_repair);
  command.add_option("path", options.paths, "recordings (.gt3x) or folders of them")->required();
  command.add_option("-o,--output", options.folder, "the folder for repaired files")->required();
  add_source_options(command, options.sources);
  add_repair_options(command, options.repair);
  command.add_flag("--dry-run", options.repair.dry_run, "compute everything, write nothing");
  command.add_flag("--resume", options.repair.resume,
                   "go on with an earlier run: what it finished is left as it is");
  add_redo_option(command, options.repair.redo_outdated);
  add_salvage_option(command, options.repair.salvage);
  add_link_option(command, options.link);
  command.add_flag("--report", options.report,
                   "also report.html in the output folder: a page about files and units");
  add_jobs_option(command, options.jobs);
}

}  // namespace sixpoint::cli
