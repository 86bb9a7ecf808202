// sixpoint repair PATH... -o OUTDIR: mends affected files; the originals stay as they are.
#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "repair/constants_finder.h"
#include "repair/repair_file.h"
#include "station/cli/command.h"
#include "station/cli/file_tree.h"
#include "station/cli/store_option.h"
#include "station/cli/workers.h"
#include "station/software.h"

namespace sixpoint::cli {
namespace {

using repair::RepairReport;
using repair::RepairStatus;

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

int exit_code_of(const RepairReport& report) {
  switch (report.status) {
    case RepairStatus::failed:
      return static_cast<int>(report.error ? report.error->code : ErrorCode::internal);
    case RepairStatus::not_repairable:
      return kExitFailed;
    default:
      return kExitPassed;
  }
}

RepairReport failed(const std::string& input, const Error& error) {
  RepairReport report;
  report.input = input;
  report.error = error;
  report.reasons.push_back(error.brief());
  return report;
}

// What the store is told about a file that was mended.
db::RepairRecord record_of(Context& context, const RepairReport& report) {
  db::RepairRecord record;
  record.serial = report.serial;
  record.made_at = context.env.clock.now();
  record.input = report.input;
  record.input_sha256 = report.input_sha256;
  record.output_sha256 = report.output_sha256;
  record.method = report.method;
  record.constants_id = report.constants_id;
  record.document = report.to_json().dump(-1, ' ', false, Json::error_handler_t::replace);
  record.software = station::software_name();
  if (const std::string build = station::software_build(); !build.empty()) {
    record.software += fmt::format(" ({})", build);
  }
  return record;
}

// Tells the store about all files that were mended. A file of an earlier run (--resume) is told
// only when that run ended before it could say so. Nothing where there was nothing to say.
Result<std::optional<db::Kept>> remember(Context& context, const std::string& location,
                                         db::Store store,
                                         const std::vector<RepairReport>& reports) {
  std::vector<db::RepairRecord> records;
  for (const RepairReport& report : reports) {
    if (report.status != RepairStatus::repaired || report.dry_run) {
      continue;
    }
    if (report.resumed) {
      const auto known = store.repair_of_output(report.output_sha256);
      if (known && *known && (*known)->input_sha256 == report.input_sha256) {
        continue;
      }
    }
    db::RepairRecord record = record_of(context, report);
    if (report.resumed && !record.constants_id.empty()) {
      // The mark may name constants of another store.
      const auto known = store.history(report.serial);
      const bool here =
          known && std::any_of(known->begin(), known->end(), [&](const auto& constants) {
            return constants.id == record.constants_id;
          });
      record.constants_id = here ? record.constants_id : "";
    }
    // One file with a serial number that no store keeps must not stand in the way of the others.
    if (const auto id = db::id_of(record); !id) {
      context.log().error("{}: mended, but the store cannot keep it: {}", printable(report.input),
                          id.error().brief());
      context.worsen(static_cast<int>(id.error().code));
      continue;
    }
    records.push_back(std::move(record));
  }
  if (records.empty()) {
    return std::nullopt;
  }
  Result<db::Store> taken = std::move(store);
  std::size_t acknowledged = 0;
  SIXPOINT_ASSIGN(auto kept,
                  keep_records(context, location, taken, [&](db::Keeper& keeper) -> Status {
                    for (; acknowledged < records.size(); ++acknowledged) {
                      SIXPOINT_CHECK(keeper.add_repair(records[acknowledged]));
                    }
                    return {};
                  }));
  return kept;
}

Result<repair::ConstantsFinderOptions> sources(const Options& options, Context& context,
                                               std::optional<db::Store>& store) {
  repair::ConstantsFinderOptions finder;
  finder.still = options.repair.still;
  if (!options.constants.empty()) {
    SIXPOINT_ASSIGN(const auto bytes, read_file(context.env.files, options.constants, 1U << 20));
    auto record = calib::parse_constants_record(
        std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
    if (!record) {
      Error error = record.error();
      error.where = options.constants;
      return fail(std::move(error));
    }
    finder.given = *std::move(record);
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
    const auto found = find_files(files, path, {".gt3x"});
    if (!found) {
      reports.push_back(failed(path, found.error()));
      continue;
    }
    if (found->empty()) {
      context.log().warn("{}: no .gt3x file below this folder", printable(path));
    }
    for (const FoundFile& file : *found) {
      const std::string output = options.folder + "/" + file.relative;
      const auto [other, fresh] = taken.emplace(output, file.path);
      if (!fresh) {
        reports.push_back(failed(
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
              report = failed(jobs[i].input, made.error());
              return;
            }
          }
          report = repair::repair_file(context.env, jobs[i].input, jobs[i].output, finder,
                                       options.repair);
        },
        [&](std::size_t done) { progress.at(done); });
  }

  Json summary = {{"files", reports.size()},
                  {"repaired", 0},
                  {"not_affected", 0},
                  {"not_repairable", 0},
                  {"already_repaired", 0},
                  {"failed", 0},
                  {"dry_run", options.repair.dry_run}};
  for (const RepairReport& report : reports) {
    context.worsen(exit_code_of(report));
    const std::string status(to_string(report.status));
    summary[status] = summary[status].get<int>() + 1;
  }
  Json kept_json(nullptr);
  if (store) {
    const auto kept = remember(context, options.store, *std::move(store), reports);
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
    json["summary"] = summary;
    json["kept"] = kept_json;
    return print_json(context, json);
  }
  for (const RepairReport& report : reports) {
    context.out << report.brief() << '\n';
    if (report.status != RepairStatus::repaired) {
      for (const std::string& reason : report.reasons) {
        context.out << "                 " << printable(reason) << '\n';
      }
    }
  }
  context.people << fmt::format(
      "{} files: {} repaired{}, {} not affected, {} already repaired, {} not repairable, {} "
      "failed\n",
      reports.size(), summary["repaired"].get<int>(),
      options.repair.dry_run ? " (dry run: nothing was written)" : "",
      summary["not_affected"].get<int>(), summary["already_repaired"].get<int>(),
      summary["not_repairable"].get<int>(), summary["failed"].get<int>());
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
