#include "repair/archive/shard_results.h"

#include <algorithm>
#include <array>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "base/text/json_text.h"
#include "repair/archive/archive_json.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kResultSchema = "sixpoint/archive-result/1";
constexpr std::uint64_t kLargestResult = 1ULL << 30;
std::string result_line(std::size_t index, const RepairReport& report) {
  Json json = {
      {"file", index},
      {"report", report.to_json()},
      {"error", report.error ? error_to_json(*report.error) : Json(nullptr)},
      {"repaired_at", report.repaired_at ? Json(to_iso8601(*report.repaired_at)) : Json(nullptr)}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

// Of a key that may hold null.
template <class T>
std::optional<T> optional_of(const Json& json) {
  return json.is_null() ? std::nullopt : std::optional(json.get<T>());
}

// What result_line() wrote; nlohmann's exceptions go to read().
Result<RepairReport> report_of(const Json& json) {
  const Json& from = json.at("report");
  RepairReport report;
  const auto status = parse_repair_status(from.at("status").get<std::string>());
  if (!status) {
    return fail(ErrorCode::bad_data, "a status of no known kind");
  }
  report.status = *status;
  report.output = optional_of<std::string>(from.at("output")).value_or("");
  if (from.contains("linked")) {
    report.linked = optional_of<std::string>(from["linked"]).value_or("");
  }
  report.method = optional_of<std::string>(from.at("method")).value_or("");
  report.reasons = from.at("reasons").get<std::vector<std::string>>();
  report.serial = from.at("serial");
  // Absent from results of earlier versions.
  if (const auto time = optional_of<std::string>(from.value("calibration_time", Json()))) {
    SIXPOINT_ASSIGN(report.calibration_time, parse_iso8601(*time));
  }
  report.samples = integer_of<std::uint64_t>(from.at("samples"));
  report.clipped_before = integer_of<std::uint64_t>(from.at("clipped_before"));
  report.clipped_after = integer_of<std::uint64_t>(from.at("clipped_after"));
  report.still_blocks = integer_of<std::size_t>(from.at("still_blocks"));
  report.verdict = optional_of<std::string>(from.value("verdict", Json())).value_or("");
  report.sides = from.value("sides", std::vector<std::string>());
  report.still_error_before_mg = optional_of<double>(from.at("still_error_mg").at("before"));
  report.still_error_after_mg = optional_of<double>(from.at("still_error_mg").at("after"));
  report.rotation_undone = from.at("rotation_undone");
  report.for_a_person = from.value("for_a_person", false);
  report.forced = from.at("forced");
  report.cross_axis_applied = from.at("cross_axis_applied");
  report.sample_uncertainty_mg = optional_of<PerAxis<double>>(from.at("sample_uncertainty_mg"));
  report.source = parse_source_used(from.at("source"));
  report.constants_id = optional_of<std::string>(from.at("constants_id")).value_or("");
  report.input_sha256 = optional_of<std::string>(from.at("input_sha256")).value_or("");
  report.output_sha256 = optional_of<std::string>(from.at("output_sha256")).value_or("");
  if (const Json& error = json.at("error"); !error.is_null()) {
    SIXPOINT_ASSIGN(report.error, error_from_json(error));
  }
  if (const Json& time = json.at("repaired_at"); !time.is_null()) {
    SIXPOINT_ASSIGN(report.repaired_at, parse_iso8601(time.get<std::string>()));
  }
  return report;
}

}  // namespace

Result<ShardFolder> ShardFolder::open(FileSystem& files, const std::string& folder,
                                      const ArchivePlan& plan, std::size_t shard) {
  SIXPOINT_ASSIGN(auto manifest, read_manifest(files, folder, plan, shard));
  return ShardFolder(files, fmt::format("{}/results/{:05}", folder, shard), plan, shard,
                     std::move(manifest));
}

std::vector<std::string> ShardFolder::parts() const {
  std::vector<std::string> paths;
  if (const auto names = files_->list(parts_folder())) {
    for (const std::string& name : *names) {
      paths.push_back(parts_folder() + "/" + name);
    }
  }
  return paths;
}

Status ShardFolder::write(const std::string& path, const ShardReports& reports) const {
  std::string body;
  for (const auto& [index, report] : reports.reports) {
    body += result_line(index, report);
  }
  const Json header = {{"schema", kResultSchema},
                       {"plan", plan_->id},
                       {"shard", shard_},
                       {"output_folder", encode_path(reports.output_folder)},
                       {"software", reports.software},
                       {"files", reports.reports.size()},
                       {"sha256", text_sha256(body)}};
  return write_file(*files_, path,
                    header.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n" + body);
}

Result<ShardReports> ShardFolder::read(const std::string& path) const {
  SIXPOINT_ASSIGN(const auto bytes, read_file(*files_, path, kLargestResult));
  try {
    if (auto reports = parse(as_text(bytes))) {
      return reports;
    }
  } catch (const Json::exception&) {
    // Said below: what is missing makes no difference to the reader.
  }
  return fail(ErrorCode::bad_data, "the result is damaged or belongs to another plan", path,
              "run the shard again");
}

Result<ShardReports> ShardFolder::parse(std::string_view text) const {
  const std::string_view first = text.substr(0, text.find('\n'));
  text.remove_prefix(std::min(text.size(), first.size() + 1));
  const Json header = parse_json(first);
  if (header.at("schema") != kResultSchema || header.at("plan") != plan_->id ||
      header.at("shard") != shard_ || header.at("sha256") != text_sha256(text)) {
    return fail(ErrorCode::bad_data, "another result");
  }
  ShardReports all;
  SIXPOINT_ASSIGN(all.output_folder, decode_path(header.at("output_folder").get<std::string>()));
  all.software = header.at("software");
  std::set<std::size_t> seen;
  for (const std::string_view line : lines_of(text)) {
    const Json json = parse_json(line);
    const auto index = integer_of<std::size_t>(json.at("file"));
    if (index >= manifest_.size() || !seen.insert(index).second) {
      return fail(ErrorCode::bad_data, "a file that is not in the shard");
    }
    SIXPOINT_ASSIGN(auto report, report_of(json));
    // JSON holds no bytes that are no UTF-8; the manifest does.
    report.input = input_of(index);
    for (std::string* name : {&report.output, &report.linked}) {
      if (!name->empty()) {
        *name = all.output_folder + "/" + manifest_[index].relative;
      }
    }
    all.reports.emplace_back(index, std::move(report));
  }
  return all;
}

Result<ShardReports> ShardFolder::read_whole() const {
  SIXPOINT_ASSIGN(auto all, read(result_path()));
  if (all.reports.size() != manifest_.size()) {
    return fail(ErrorCode::bad_data, "the result does not have all files of the shard",
                result_path(), "run the shard again");
  }
  return all;
}

std::vector<std::optional<RepairReport>> ShardFolder::known() const {
  std::vector<std::optional<RepairReport>> reports(manifest_.size());
  std::vector<std::string> paths = parts();
  paths.insert(paths.begin(), result_path());
  for (const std::string& path : paths) {
    auto part = read(path);
    if (!part) {
      continue;  // damaged: its files are done again, and their outputs known by their marks
    }
    for (auto& [index, report] : part->reports) {
      reports[index] = std::move(report);
    }
  }
  return reports;
}

std::string_view to_string(ShardState state) {
  constexpr std::array<std::string_view, 5> kNames = {"done", "running", "partly", "missing",
                                                      "damaged"};
  return kNames[static_cast<std::size_t>(state)];
}

Result<ShardResult> read_result(FileSystem& files, const std::string& folder,
                                const ArchivePlan& plan, std::size_t shard) {
  SIXPOINT_ASSIGN(const auto opened, ShardFolder::open(files, folder, plan, shard));
  SIXPOINT_ASSIGN(auto all, opened.read_whole());
  ShardResult result{shard, all.output_folder, all.software, {}};
  std::ranges::sort(all.reports, {}, [](const auto& one) { return one.first; });
  for (auto& [index, report] : all.reports) {
    result.files.push_back(std::move(report));
  }
  return result;
}

void add_to(RepairProgress& done, const ArchiveFile& file, const RepairReport& report) {
  ++done.files;
  done.bytes += file.size;
  done.failed += report.status == RepairStatus::failed ? 1 : 0;
}

RepairProgress progress_of(const std::vector<ArchiveFile>& manifest,
                           const std::vector<std::optional<RepairReport>>& reports) {
  RepairProgress done;
  for (std::size_t i = 0; i < reports.size(); ++i) {
    if (reports[i]) {
      add_to(done, manifest[i], *reports[i]);
    }
  }
  return done;
}

ShardStanding standing_of(FileSystem& files, const std::string& folder, const ArchivePlan& plan,
                          std::size_t shard) {
  const auto opened = ShardFolder::open(files, folder, plan, shard);
  if (!opened) {
    const ErrorCode code = opened.error().code;
    const bool is_of_plan = code == ErrorCode::configuration || code == ErrorCode::bad_data ||
                            code == ErrorCode::no_input;
    return {ShardState::damaged, is_of_plan, {}};
  }
  ShardStanding standing;
  standing.done = progress_of(opened->manifest(), opened->known());
  if (files.info(opened->lock_path())) {
    const auto lock = files.lock(opened->lock_path());
    if (lock && *lock == nullptr) {
      standing.state = ShardState::running;
      return standing;
    }
  }
  const auto whole = opened->read_whole();
  if (whole) {
    standing.state = ShardState::done;
  } else if (whole.error().code != ErrorCode::no_input) {
    standing.state = ShardState::damaged;
  } else if (standing.done.files > 0) {
    standing.state = ShardState::partly;
  }
  return standing;
}

}  // namespace sixpoint::repair
