// What the commands that repair recordings (repair, archive) have in common: options, the line per
// file, the summary, the records for the store.
//
//   add_source_options(command, sources);
//   SIXPOINT_ASSIGN(auto store, store_of(context, sources));
//   RepairTally tally;
//   for (const repair::RepairReport& report : reports) {
//     tally.add(context, report);
//     print_report(context, report);
//   }
//   context.people << tally.brief(dry_run);
#pragma once

#include <map>
#include <string>
#include <vector>

#include "cli/context.h"
#include "cli/store_option.h"
#include "repair/archive/link_file.h"
#include "repair/batch/repair_files.h"
#include "repair/rescale/repair_file.h"
#include "repair/rescale/sources.h"
#include "repair/units/unit_needs.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

// Where the constants come from.
struct RepairSources {
  std::string constants;         // --constants C.json
  std::string store;             // --store
  std::string calibration_file;  // --calibration-file FILE.gt3x
  bool scan = false;             // --scan
  bool or_scan = false;          // --or-scan
  bool no_pool = false;          // --no-pool
};
void add_source_options(CLI::App& command, RepairSources& sources);
// The order in which they are asked (repair/rescale/sources.h). `has_store`: store_of() gave one.
std::vector<repair::SourceKind> order_of(const RepairSources& sources, bool has_store);
// --wide, --store-only, --undo-rotation, --allow-prior, --force
void add_repair_options(CLI::App& command, repair::RepairOptions& options);

// --link-unaffected hard|symbolic
void add_link_option(CLI::App& command, repair::LinkKind& link);
// --redo-outdated
void add_redo_option(CLI::App& command, bool& redo_outdated);

// The store that keeps what was repaired, and is asked for constants where order_of() has it:
//
//   --store  --scan  --calibration-file  store
//   given    any     any                 the one that is named; an error where it is missing
//   -        given   -                   none
//   -        other cases                 the default store, where it exists
Result<std::optional<db::Store>> store_of(Context& context, const RepairSources& sources);

using repair::failed_report;
using repair::read_constants;

// Counts reports by their status.
class RepairTally {
 public:
  // Counts the report, and keeps the worst exit code:
  //
  //   repaired, not_affected, already_repaired   0
  //   not_repairable, outdated                   1
  //   failed                                     the error's
  void add(Context& context, const repair::RepairReport& report);
  // {files, repaired, not_affected, not_repairable, already_repaired, outdated, failed,
  // dry_run}
  Json to_json(bool dry_run) const;
  std::string brief(bool dry_run) const;  // one line, with its line end

 private:
  std::size_t of(repair::RepairStatus status) const;
  std::size_t files_ = 0;
  std::map<repair::RepairStatus, std::size_t> counts_;
};

// Writes the page about the files (repair/report/study_report.h), which reads the worst of them.
Status write_study_report(Context& context, FileSystem& files, const std::string& path,
                          const std::string& title,
                          const std::vector<repair::RepairReport>& reports);

// The table of units for people, at most 20 of them; nothing where none needs a word.
void print_units(Context& context, const std::vector<repair::UnitNeeds>& units);

// A line on stdout with source and still error, and the reasons below it.
void print_report(Context& context, const repair::RepairReport& report);

// Adds the files that were repaired to the store, each once. `store` is the result of open_store().
// An error is reported with the hint `again`; it counts into the exit code. `software`: what
// repaired the files; empty stands for this program. Returns kept_to_json(), {"in": null, "error"},
// or null where there was nothing to add.
Json keep_repairs(Context& context, const std::string& location, Result<db::Store>& store,
                  const std::vector<repair::RepairReport>& reports, const std::string& again,
                  const std::string& software = {});

}  // namespace sixpoint::cli
