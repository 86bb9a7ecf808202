#include "repair/batch/repair_files.h"

#include <algorithm>
#include <optional>

#include "base/bytes.h"
#include "repair/batch/jobs.h"

namespace sixpoint::repair {
namespace {

RepairReport repair_one(Env& env, const NamedFile& file, const std::string& folder,
                        const RepairOptions& how, ConstantsSource& source) {
  if (file.error) {
    return failed_report(file.path, *file.error);
  }
  const std::string output = folder + "/" + file.relative;
  if (!how.dry_run) {
    if (const auto made = env.files.make_folders(folder_of(output)); !made) {
      return failed_report(file.path, made.error());
    }
  }
  return repair_file(env, file.path, output, source, how);
}

}  // namespace

Result<calib::ConstantsRecord> read_constants(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const auto bytes, read_file(files, path, 1U << 20));
  auto record = calib::parse_constants_record(as_text(bytes));
  if (!record) {
    Error error = record.error();
    error.where = path;
    return fail(std::move(error));
  }
  return record;
}

RepairReport failed_report(const std::string& input, const Error& error) {
  RepairReport report;
  report.input = input;
  report.error = error;
  report.reasons.push_back(error.brief());
  return report;
}

std::vector<RepairReport> repair_files(Env& env, const std::vector<NamedFile>& files,
                                       const RepairFilesOptions& options, ConstantsSource& source,
                                       const std::function<void(std::size_t)>& watch,
                                       const std::atomic<bool>* stop) {
  RepairOptions how = options.repair;
  how.resume = how.resume || how.redo_outdated;
  const unsigned jobs = threads_of(options.jobs);
  how.jobs =
      std::max(1U, jobs / static_cast<unsigned>(std::clamp<std::size_t>(files.size(), 1, jobs)));
  std::vector<std::optional<RepairReport>> answers(files.size());
  for_each_job(
      files.size(), options.jobs,
      [&](std::size_t i) { answers[i] = repair_one(env, files[i], options.folder, how, source); },
      watch, stop);
  std::vector<RepairReport> reports;
  for (std::optional<RepairReport>& answer : answers) {
    if (answer) {
      reports.push_back(*std::move(answer));
    }
  }
  return reports;
}

}  // namespace sixpoint::repair
