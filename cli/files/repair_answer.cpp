#include "cli/files/repair_answer.h"

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/text/counted.h"
#include "cli/command.h"
#include "cli/people_text.h"
#include "repair/batch/answers.h"
#include "repair/report/study_report.h"
#include "repair/rescale/repair_records.h"
#include "station/records/software.h"

namespace sixpoint::cli {

using repair::RepairReport;
using repair::RepairStatus;

void add_source_options(CLI::App& command, RepairSources& sources) {
  command.add_option("--constants", sources.constants,
                     "use these constants (constants.json), and no others");
  command.add_option("--calibration-file", sources.calibration_file,
                     "use a recording of the unit lying still on each of its six sides");
  command.add_flag("--scan", sources.scan, "use the still periods of the unit's files");
  add_store_option(command, sources.store);
  command.add_flag("--or-scan", sources.or_scan, "still periods where what is named does not fit");
  command.add_flag("--no-pool", sources.no_pool,
                   "never use the still periods of the unit's other files");
}

std::vector<repair::SourceKind> order_of(const RepairSources& sources, bool has_store) {
  repair::NamedSources named;
  named.constants = !sources.constants.empty();
  named.calibration_file = !sources.calibration_file.empty();
  named.scan = sources.scan;
  named.store = !sources.store.empty();
  named.or_scan = sources.or_scan;
  named.default_store = has_store && sources.store.empty();
  named.unit_files = !sources.no_pool;
  return repair::sources_in_order(named);
}

void add_repair_options(CLI::App& command, repair::RepairOptions& options) {
  command.add_flag("--wide", options.wide,
                   "write 16-bit records (ACTIVITY2), in which nothing needs clipping");
  command.add_flag("--store-only", options.store_only,
                   "store the entries of repaired files instead of deflating them");
  command.add_flag("--undo-rotation", options.undo_rotation,
                   "also turn back the axes of firmware 1.6.0 where the constants are right");
  command.add_flag("--allow-prior", options.allow_prior,
                   "also use constants that rest on a population prior");
  command.add_flag("--force", options.force,
                   "write a file also where its own still periods say that it does not help");
}

void add_link_option(CLI::App& command, repair::LinkKind& link) {
  command
      .add_option_function<std::string>(
          "--link-unaffected",
          [&link](const std::string& text) { link = *repair::parse_link_kind(text); },
          "hard or symbolic: links of the files that need no repair, so that the output folder "
          "holds the whole study")
      ->check(CLI::IsMember(std::vector<std::string>{"hard", "symbolic"}));
}

void add_redo_option(CLI::App& command, bool& redo_outdated) {
  command.add_flag("--redo-outdated", redo_outdated,
                   "replace outputs that were made otherwise than they would be made now");
}

Result<std::optional<db::Store>> store_of(Context& context, const RepairSources& sources) {
  const bool only_scan = sources.scan && sources.calibration_file.empty();
  if (sources.store.empty() && (only_scan || !store_exists(context, ""))) {
    return std::nullopt;
  }
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, sources.store));
  return store;
}

void RepairTally::add(Context& context, const RepairReport& report) {
  ++files_;
  ++counts_[report.status];
  if (report.status == RepairStatus::failed) {
    context.worsen(report.error ? report.error->code : ErrorCode::internal);
  } else if (report.status == RepairStatus::not_repairable ||
             report.status == RepairStatus::outdated) {
    context.worsen(kExitFailed);
  }
}

std::size_t RepairTally::of(RepairStatus status) const {
  const auto found = counts_.find(status);
  return found == counts_.end() ? 0 : found->second;
}

Json RepairTally::to_json(bool dry_run) const { return repair::repair_summary(counts_, dry_run); }

std::string RepairTally::brief(bool dry_run) const {
  return fmt::format(
      "{}: {} repaired{}, {} not affected, {} already repaired, {} not repairable, {} "
      "outdated, {} failed\n",
      counted(files_, "file"), of(RepairStatus::repaired),
      dry_run ? " (dry run: nothing was written)" : "", of(RepairStatus::not_affected),
      of(RepairStatus::already_repaired), of(RepairStatus::not_repairable),
      of(RepairStatus::outdated), of(RepairStatus::failed));
}

Status write_study_report(Context& context, FileSystem& files, const std::string& path,
                          const std::string& title, const std::vector<RepairReport>& reports) {
  repair::StudyReport study;
  for (const RepairReport& report : reports) {
    study.add(report);
  }
  study.add_thumbnails(context.env.files);
  return write_file(
      files, path,
      study.html({title, local_time(context.env.clock.now()), station::software_and_build()}));
}

void print_units(Context& context, const std::vector<repair::UnitNeeds>& units) {
  constexpr std::size_t kShown = 20;
  if (!units.empty()) {
    context.people << repair::units_text(units, kShown);
  }
}

void print_report(Context& context, const RepairReport& report) {
  context.out << report.brief() << '\n';
  for (const std::string& reason : report.reasons) {
    context.out << "                 " << printable(reason) << '\n';
  }
}

Json keep_repairs(Context& context, const std::string& location, Result<db::Store>& store,
                  const std::vector<RepairReport>& reports, const std::string& again,
                  const std::string& software) {
  const auto failed = [&](const Error& error) -> Json {
    context.log().error("the files are repaired, but the store has no record of them: {}; {}",
                        error.brief(), again);
    context.worsen(error.code);
    return {{"in", nullptr}, {"error", error_to_json(error)}};
  };
  if (!store) {
    return failed(store.error());
  }
  const auto made = repair::records_of(*store, reports,
                                       software.empty() ? station::software_and_build() : software);
  for (const repair::RefusedPath& refused : made.refused) {
    context.log().error("{}: repaired, but the store cannot keep its record: {}",
                        printable(refused.path), refused.error.brief());
    context.worsen(refused.error.code);
  }
  if (made.records.empty()) {
    return nullptr;
  }
  std::size_t acknowledged = 0;
  const auto kept = keep_records(context, location, store, [&](db::RecordWriter& writer) -> Status {
    for (; acknowledged < made.records.size(); ++acknowledged) {
      SIXPOINT_CHECK(writer.add_repair(made.records[acknowledged]));
    }
    return {};
  });
  return kept ? kept_to_json(*kept) : failed(kept.error());
}

}  // namespace sixpoint::cli
