// sixpoint repair PATH... -o OUTDIR: repairs affected files; the originals stay as they are.
#include <map>

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/files/repair_answer.h"
#include "cli/output.h"
#include "cli/store_option.h"
#include "cli/workers.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/repair_file.h"
#include "repair/triage/file_tree.h"

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

// Two inputs must not have one output: the second one is refused.
void refuse_same_outputs(std::vector<NamedFile>& files, const std::string& folder) {
  std::map<std::string, std::string> input_of;  // by the name below the output folder
  for (NamedFile& file : files) {
    if (file.error) {
      continue;
    }
    const auto [other, fresh] = input_of.emplace(file.relative, file.path);
    if (!fresh) {
      file.error = Error{ErrorCode::cannot_create,
                         fmt::format("{} would have the same name in {}", other->second, folder),
                         file.path, "repair the two in separate runs, into separate folders"};
    }
  }
}

RepairReport repair_one(const NamedFile& file, const Options& options,
                        repair::ConstantsFinder& finder, Env& env) {
  if (file.error) {
    return failed_report(file.path, *file.error);
  }
  const std::string output = options.folder + "/" + file.relative;
  if (!options.repair.dry_run) {
    if (const auto made = env.files.make_folders(folder_of(output)); !made) {
      return failed_report(file.path, made.error());
    }
  }
  return repair::repair_file(env, file.path, output, finder, options.repair);
}

Status run(const Options& options, Context& context) {
  Outputs outputs(context, {}, options.json);
  SIXPOINT_CHECK(outputs.working_folder("--output", options.folder));
  std::optional<db::Store> store;
  SIXPOINT_ASSIGN(auto how, finder_options(options, context, store));
  repair::ConstantsFinder finder(context.env, std::move(how));

  auto files = named_files(context, options.paths, {".gt3x"});
  refuse_same_outputs(files, options.folder);
  const auto reports = for_each_file<RepairReport>(
      context, "repairing", files, options.jobs,
      [&](const NamedFile& file) { return repair_one(file, options, finder, context.env); });
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
    return print_json(context, json);
  }
  for (const RepairReport& report : reports) {
    print_report(context, report);
  }
  context.people << tally.brief(options.repair.dry_run);
  return {};
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
  add_jobs_option(command, options.jobs);
}

}  // namespace sixpoint::cli
