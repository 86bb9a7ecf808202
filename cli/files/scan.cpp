// sixpoint scan PATH...: which files are affected by 16CPAN03, and whether their samples show it.
#include <mutex>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/text/counted.h"
#include "cli/command.h"
#include "cli/files/repair_answer.h"
#include "cli/output.h"
#include "cli/people_text.h"
#include "cli/store_option.h"
#include "cli/workers.h"
#include "repair/batch/answers.h"
#include "repair/rescale/known_calibration.h"
#include "repair/triage/scan_file.h"

namespace sixpoint::cli {
namespace {

struct ScanCommandOptions {
  std::vector<std::string> paths;
  std::string store;
  std::string units;
  OutputOptions outputs;
  unsigned jobs = 0;
  bool json = false;
};

using repair::ScannedFile;

//   verdict         exit code
//   not_affected    0
//   affected        1
//   cannot_tell     2
//   unreadable      the error's
void judge(Context& context, const ScannedFile& file) {
  if (file.error) {
    context.worsen(file.error->code);
  } else if (file.verdict != to_string(repair::Verdict::not_affected)) {
    context.worsen(file.verdict == to_string(repair::Verdict::affected) ? kExitFailed
                                                                        : kExitInconclusive);
  }
}

// The dates of calibration that the store knows. It is opened for the first file that needs one:
// who never named a store shall not hear of it.
class DatesInStore {
 public:
  DatesInStore(Context& context, const std::string& location)
      : context_(context), location_(location) {}

  // A store that was named must be there.
  Status check() {
    if (!location_.empty()) {
      SIXPOINT_ASSIGN(store_, open_existing_store(context_, location_));
    }
    return {};
  }

  // From any thread.
  repair::KnownDate of(const std::string& serial) {
    const std::scoped_lock lock(mutex_);
    if (!store_ && !store_exists(context_, location_)) {
      return {};
    }
    if (!store_) {
      auto opened = open_existing_store(context_, location_);
      if (!opened) {
        return {std::nullopt, opened.error().brief()};
      }
      store_ = *std::move(opened);
    }
    const auto history = store_->unit_history(serial);
    return history ? repair::calibration_date(*history)
                   : repair::KnownDate{std::nullopt, history.error().brief()};
  }

 private:
  Context& context_;
  std::string location_;
  std::mutex mutex_;
  std::optional<db::Store> store_;
};

Status run_scan(const ScanCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.file("--units", options.units));
  const auto files = named_files(context, options.paths, {".gt3x", ".agdc", ".agd"});
  for (const NamedFile& file : options.units.empty() ? std::vector<NamedFile>() : files) {
    SIXPOINT_CHECK(outputs.input(file.path));
  }
  DatesInStore dates(context, options.store);
  SIXPOINT_CHECK(dates.check());
  const auto lookup = [&](const std::string& serial) { return dates.of(serial); };
  const auto answers = for_each_file<ScannedFile>(
      context, "scanning", files, options.jobs, [&](const NamedFile& file) {
        return file.error ? repair::unreadable_file(file.path, *file.error)
                          : repair::scan_file(context.env.files, file.path, lookup);
      });
  Json json = document("scan");
  Json& list = json["files"] = Json::array();
  std::string text;
  repair::UnitTable table;
  for (const ScannedFile& answer : answers) {
    judge(context, answer);
    table.add(answer);
    list.push_back(repair::scanned_to_json(answer));
    text += fmt::format("{:<13} {}", answer.verdict, printable(answer.path));
    for (const std::string& reason : answer.reasons) {
      text += "\n              " + printable(reason);
    }
    text += '\n';
  }
  const Json summary = json["summary"] = repair::scan_summary(answers);
  const auto units = table.rows();
  json["units"] = repair::units_json(units);
  if (!options.units.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.units, repair::units_csv(units)));
  }
  print_answer(context, options.json, json, text);
  if (!options.json) {
    print_units(context, units);
    const auto count = [&](const char* key) { return summary[key].get<int>(); };
    context.people << fmt::format("{}: {} affected, {} not, {} cannot be told, {} unreadable\n",
                                  counted(answers.size(), "file"), count("affected"),
                                  count("not_affected"), count("cannot_tell"), count("unreadable"));
    if (count("affected") > 0) {
      std::vector<std::string> next = some_paths(options.paths);
      next.insert(next.begin(), "repair");
      next.insert(next.end(), {"-o", "repaired"});
      next_step(context, options.json, next);
    }
  }
  return {};
}

}  // namespace

void add_scan(CLI::App& app, Context& context) {
  auto [command, options] = add_command<ScanCommandOptions>(
      app, context, "scan", "find the files that 16CPAN03 affects", run_scan);
  command.add_option("path", options.paths, "recordings (.gt3x, .agdc, .agd) or folders of them")
      ->required();
  command.add_option("--units", options.units, "a line per unit, as CSV: what is missing");
  add_output_options(command, options.outputs);
  add_jobs_option(command, options.jobs);
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli
