// How commands that mend files answer: a line per file, a summary, an exit code; and what they tell
// the store.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "repair/repair_file.h"
#include "station/cli/command.h"
#include "station/cli/store_option.h"

namespace sixpoint::cli {

int exit_code_of(const repair::RepairReport& report);

// --constants C.json
Result<calib::ConstantsRecord> read_constants(FileSystem& files, const std::string& path);

// The report of a file that was not even looked into.
repair::RepairReport failed_report(const std::string& input, const Error& error);

// The counts over all files.
class RepairTally {
 public:
  void add(const repair::RepairReport& report);
  std::size_t files() const { return files_; }
  // {files, repaired, not_affected, not_repairable, already_repaired, failed, dry_run}
  Json to_json(bool dry_run) const;
  std::string brief(bool dry_run) const;  // one line with its end

 private:
  std::size_t of(repair::RepairStatus status) const;
  std::size_t files_ = 0;
  std::map<repair::RepairStatus, std::size_t> counts_;
};

// A line for people on stdout, and the reasons where the file was not mended.
void print_report(Context& context, const repair::RepairReport& report);

// Tells the store about all files that were mended and that it does not know. Files that it cannot
// keep are said to people and count into the exit code. Nothing where there was nothing to say.
// `store` is left as keep_records() leaves it. `software`: empty stands for this program.
Result<std::optional<db::Kept>> keep_repairs(Context& context, const std::string& location,
                                             Result<db::Store>& store,
                                             const std::vector<repair::RepairReport>& reports,
                                             const std::string& software = {});

// "sixpoint 0.1.0 (1d698a7c04db)"
std::string software_and_build();

}  // namespace sixpoint::cli
