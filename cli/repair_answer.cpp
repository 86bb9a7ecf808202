#include "station/cli/repair_answer.h"

#include <fmt/format.h>

#include "repair/repair_records.h"
#include "station/software.h"

namespace sixpoint::cli {

using repair::RepairReport;
using repair::RepairStatus;

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

Result<calib::ConstantsRecord> read_constants(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const auto bytes, read_file(files, path, 1U << 20));
  auto record = calib::parse_constants_record(
      std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
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

void RepairTally::add(const RepairReport& report) {
  ++files_;
  ++counts_[report.status];
}

std::size_t RepairTally::of(RepairStatus status) const {
  const auto found = counts_.find(status);
  return found == counts_.end() ? 0 : found->second;
}

Json RepairTally::to_json(bool dry_run) const {
  Json summary = {{"files", files_}};
  for (const RepairStatus status :
       {RepairStatus::repaired, RepairStatus::not_affected, RepairStatus::not_repairable,
        RepairStatus::already_repaired, RepairStatus::failed}) {
    summary[std::string(repair::to_string(status))] = of(status);
  }
  summary["dry_run"] = dry_run;
  return summary;
}

std::string RepairTally::brief(bool dry_run) const {
  return fmt::format(
      "{} files: {} repaired{}, {} not affected, {} already repaired, {} not repairable, {} "
      "failed\n",
      files_, of(RepairStatus::repaired), dry_run ? " (dry run: nothing was written)" : "",
      of(RepairStatus::not_affected), of(RepairStatus::already_repaired),
      of(RepairStatus::not_repairable), of(RepairStatus::failed));
}

void print_report(Context& context, const RepairReport& report) {
  context.out << report.brief() << '\n';
  if (report.status != RepairStatus::repaired) {
    for (const std::string& reason : report.reasons) {
      context.out << "                 " << printable(reason) << '\n';
    }
  }
}

std::string software_and_build() {
  const std::string build = station::software_build();
  return build.empty() ? station::software_name()
                       : fmt::format("{} ({})", station::software_name(), build);
}

Result<std::optional<db::Kept>> keep_repairs(Context& context, const std::string& location,
                                             Result<db::Store>& store,
                                             const std::vector<RepairReport>& reports,
                                             const std::string& software) {
  if (!store) {
    return fail(store.error());
  }
  const auto made =
      repair::records_of(*store, reports, software.empty() ? software_and_build() : software);
  for (const repair::RefusedPath& refused : made.refused) {
    context.log().error("{}: mended, but the store cannot keep it: {}", printable(refused.path),
                        refused.error.brief());
    context.worsen(static_cast<int>(refused.error.code));
  }
  if (made.records.empty()) {
    return std::optional<db::Kept>();
  }
  std::size_t acknowledged = 0;
  SIXPOINT_ASSIGN(auto kept,
                  keep_records(context, location, store, [&](db::Keeper& keeper) -> Status {
                    for (; acknowledged < made.records.size(); ++acknowledged) {
                      SIXPOINT_CHECK(keeper.add_repair(made.records[acknowledged]));
                    }
                    return {};
                  }));
  return std::optional(std::move(kept));
}

}  // namespace sixpoint::cli
