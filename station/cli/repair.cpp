// sixpoint repair PATH... -o OUTDIR: mends affected files; the originals stay as they are.
#include <map>

#include <fmt/format.h>

#include "repair/constants_finder.h"
#include "repair/file_tree.h"
#include "repair/repair_file.h"
#include "station/cli/command.h"
#include "station/cli/repair_answer.h"
#include "station/cli/store_option.h"
#include "station/cli/workers.h"

namespace sixpoint::cli {
namespace {

using repair::RepairReport;

struct Options {
  std::vector<std::string> paths;
  std::string folder;
  std::string constants;
  std::string store;
  std::string calibration_file;
  bool scan = false;
  repair::RepairOptions repair;
  unsigned jobs = 0;
  bool json = false;
};

Result<repair::ConstantsFinderOptions> sources(const Options& options, Context& context,
                                               std::optional<db::Store>& store) {
  repair::ConstantsFinderOptions finder;
  finder.still = options.repair.still;
  if (!options.constants.empty()) {
    SIXPOINT_ASSIGN(finder.given, read_constants(context.env.files, options.constants));
  }
  const bool only_scan = options.scan && options.store.empty() && options.calibration_file.empty();
  if (!options.store.empty()) {
    SIXPOINT_ASSIGN(store, open_existing_store(context, options.store));
  } else if (!only_scan && store_exists(context, "")) {
    SIXPOINT_ASSIGN(store, open_existing_store(context, ""));
  }
  finder.store = store ? &*store : nullptr;
  if (!options.calibration_file.empty()) {
    SIXPOINT_CHECK(context.env.files.info(options.calibration_file));
    finder.calibration_file = options.calibration_file;
  }
  return finder;
}

struct Job {
  std::string input;
  std::string output;
};

void run(const Options& options, Context& context) {
  std::optional<db::Store> store;
  auto finder_options = sources(options, context, store);
  if (!finder_options) {
    return report_error(context, "repair", finder_options.error(), options.json);
  }
  repair::ConstantsFinder finder(context.env, *std::move(finder_options));

  FileSystem& files = context.env.files;
  std::vector<RepairReport> reports;
  std::vector<Job> jobs;
  std::vector<std::size_t> places;
  std::map<std::string, std::string> taken;  // output -> input
  for (const std::string& path : options.paths) {
    const auto found = repair::find_files(files, path, {{".gt3x"}});
    if (!found) {
      reports.push_back(failed_report(path, found.error()));
      continue;
    }
    for (const repair::RefusedPath& refused : found->refused) {
      reports.push_back(failed_report(refused.path, refused.error));
    }
    if (found->files.empty()) {
      context.log().warn("{}: no .gt3x file below this folder", printable(path));
    }
    for (const repair::FoundFile& file : found->files) {
      const std::string output = options.folder + "/" + file.relative;
      const auto [other, fresh] = taken.emplace(output, file.path);
      if (!fresh) {
        reports.push_back(failed_report(
            file.path,
            Error{ErrorCode::cannot_create,
                  fmt::format("{} would have the same name in {}", other->second, options.folder),
                  file.path, "repair the two in separate runs, into separate folders"}));
        continue;
      }
      places.push_back(reports.size());
      jobs.push_back({file.path, output});
      reports.emplace_back();
    }
  }
  {
    Progress progress(context, "repairing", jobs.size());
    for_each_job(
        jobs.size(), options.jobs,
        [&](std::size_t i) {
          RepairReport& report = reports[places[i]];
          if (!options.repair.dry_run) {
            if (const auto made = files.make_folders(folder_of(jobs[i].output)); !made) {
              report = failed_report(jobs[i].input, made.error());
              return;
            }
          }
          report = repair::repair_file(context.env, jobs[i].input, jobs[i].output, finder,
                                       options.repair);
        },
        [&](std::size_t done) { progress.at(done); });
  }

  RepairTally tally;
  for (const RepairReport& report : reports) {
    context.worsen(exit_code_of(report));
    tally.add(report);
  }
  Json kept_json(nullptr);
  if (store) {
    Result<db::Store> opened = *std::move(store);
    const auto kept = keep_repairs(context, options.store, opened, reports);
    if (!kept) {
      context.log().error(
          "the files are mended, but the store does not know: {}; run it again "
          "with --resume",
          kept.error().brief());
      context.worsen(static_cast<int>(kept.error().code));
      kept_json = {{"in", nullptr}, {"error", error_to_json(kept.error())}};
    } else if (*kept) {
      kept_json = kept_to_json(**kept);
    }
  }
  if (options.json) {
    Json json = document("repair");
    json["files"] = Json::array();
    for (const RepairReport& report : reports) {
      json["files"].push_back(report.to_json());
    }
    json["summary"] = tally.to_json(options.repair.dry_run);
    json["kept"] = kept_json;
    return print_json(context, json);
  }
  for (const RepairReport& report : reports) {
    print_report(context, report);
  }
  context.people << tally.brief(options.repair.dry_run);
}

}  // namespace

void add_repair(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("repair", "Mend affected files into another folder");
  auto options = std::make_shared<Options>();
  command->add_option("path", options->paths, "Recordings (.gt3x) or folders of them")->required();
  command->add_option("-o,--output", options->folder, "The folder for mended files")->required();
  command->add_option("--constants", options->constants, "Use these constants (constants.json)");
  add_store_option(*command, options->store);
  command->add_option("--calibration-file", options->calibration_file,
                      "A recording of the unit lying still on each of its six sides");
  command->add_flag("--scan", options->scan,
                    "Use the still periods of the file itself (also the last resort without it)");
  command->add_flag("--wide", options->repair.wide,
                    "Write 16-bit records (ACTIVITY2), in which nothing needs clipping");
  command->add_flag("--undo-rotation", options->repair.undo_rotation,
                    "Also turn back the axes of firmware 1.6.0 where the constants are right");
  command->add_flag("--allow-prior", options->repair.allow_prior,
                    "Also use constants that rest on a population prior");
  command->add_flag("--dry-run", options->repair.dry_run, "Compute everything, write nothing");
  command->add_flag("--resume", options->repair.resume,
                    "Go on with an earlier run: what it finished is left as it is");
  command->add_option("--jobs", options->jobs, "Files at a time (default: one per core)");
  command->add_flag("--json", options->json, "One JSON document on stdout");
  command->callback([options, &context] { run(*options, context); });
}

}  // namespace sixpoint::cli
