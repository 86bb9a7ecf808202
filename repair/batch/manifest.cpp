#include "repair/batch/manifest.h"

#include <map>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/text/csv_field.h"
#include "base/text/json_text.h"
#include "db/records.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kSchema = "sixpoint/repair-manifest/1";
constexpr std::string_view kColumns =
    "input,output,status,source,source_id,still_error_before_mg,still_error_after_mg,input_sha256,"
    "output_sha256\r\n";
constexpr std::uint64_t kLargestManifest = 1ULL << 30;

std::string json_of(const std::string& folder) { return folder + "/manifest.json"; }
std::string csv_of(const std::string& folder) { return folder + "/manifest.csv"; }
std::string units_of(const std::string& folder) { return folder + "/units.csv"; }

// The manifest that is there; an empty object where there is none or it is not ours.
Json manifest_in(FileSystem& files, const std::string& folder) {
  const auto bytes = read_file(files, json_of(folder), kLargestManifest);
  if (bytes) {
    Json json = parse_json(as_text(*bytes));
    if (json.is_object() && json.value("schema", Json()) == kSchema && json.contains("files") &&
        json["files"].is_array()) {
      return json;
    }
  }
  return Json::object();
}

Json entry_of(const RepairReport& report) {
  const Json all = report.to_json();
  Json entry = {{"input", db::storable_path(report.input)}, {"output", nullptr}};
  if (!report.output.empty()) {
    entry["output"] = db::storable_path(report.output);
  }
  for (const char* key : {"status", "source", "still_error_mg", "input_sha256", "output_sha256"}) {
    entry[key] = all[key];
  }
  return entry;
}

// A field as RFC 4180 has it.
std::string field(const Json& value) {
  if (value.is_number()) {
    return fmt::format("{:.3f}", value.get<double>());
  }
  if (!value.is_string()) {
    return "";
  }
  return csv_field(value.get_ref<const std::string&>());
}

std::string line_of(const Json& entry) {
  const auto at = [](const Json& json, const char* key) {
    return json.is_object() ? json.value(key, Json()) : Json();
  };
  const Json source = at(entry, "source");
  const Json error = at(entry, "still_error_mg");
  std::string line;
  for (const Json& value :
       {at(entry, "input"), at(entry, "output"), at(entry, "status"), at(source, "kind"),
        at(source, "id"), at(error, "before"), at(error, "after"), at(entry, "input_sha256"),
        at(entry, "output_sha256")}) {
    line += field(value) + ",";
  }
  line.back() = '\r';
  return line + "\n";
}

// What is known of an output that stays as an earlier run made it of this very input: that run's
// line, under this run's status. Nothing where there is no such output.
std::optional<Json> entry_of_earlier_output(const RepairReport& report, const Json& earlier) {
  const bool stays = report.status == RepairStatus::outdated ||
                     (report.error && report.error->code == ErrorCode::cannot_create);
  if (!stays || !earlier.value("output", Json()).is_string() || report.input_sha256.empty() ||
      earlier.value("input_sha256", Json()) != report.input_sha256) {
    return std::nullopt;
  }
  Json entry = earlier;
  entry["status"] = to_string(report.status);
  return entry;
}

}  // namespace

Status check_manifest(FileSystem& files, const std::string& folder) {
  const bool ours = !manifest_in(files, folder).empty();
  if (!files.link_info(json_of(folder))) {
    const auto csv = read_file(files, csv_of(folder), kLargestManifest);
    if (csv && as_text(*csv).starts_with(kColumns)) {
      return fail(
          ErrorCode::cannot_create, "manifest.json, which belongs to this file, is missing",
          csv_of(folder),
          "put manifest.json back, or choose another output folder, or move this file away");
    }
  }
  for (const std::string& path :
       {json_of(folder), csv_of(folder), units_of(folder), folder + "/report.html"}) {
    if (!ours && files.info(path)) {
      return fail(ErrorCode::cannot_create, "this is no manifest of an earlier repair", path,
                  "choose another output folder, or move the file away");
    }
  }
  return {};
}

Status write_manifest(FileSystem& files, const std::string& folder,
                      const std::vector<RepairReport>& reports, UtcTime now,
                      const std::string& software) {
  std::map<std::string, const RepairReport*> of_this_run;
  for (const RepairReport& report : reports) {
    of_this_run.emplace(db::storable_path(report.input), &report);
  }
  Json entries = Json::array();
  const Json earlier = manifest_in(files, folder);
  for (const Json& entry : earlier.value("files", Json::array())) {
    const Json input = entry.is_object() ? entry.value("input", Json()) : Json();
    if (!input.is_string()) {
      continue;
    }
    const auto now_too = of_this_run.find(input.get<std::string>());
    if (now_too == of_this_run.end()) {
      entries.push_back(entry);
    } else if (auto kept = entry_of_earlier_output(*now_too->second, entry)) {
      of_this_run.erase(now_too);
      entries.push_back(*std::move(kept));
    }
  }
  for (const RepairReport& report : reports) {
    if (of_this_run.contains(db::storable_path(report.input))) {
      entries.push_back(entry_of(report));
    }
  }
  std::string csv(kColumns);
  for (const Json& entry : entries) {
    csv += line_of(entry);
  }
  const Json json = {{"schema", kSchema},
                     {"made_at", to_iso8601(now)},
                     {"software", software},
                     {"files", std::move(entries)}};
  SIXPOINT_CHECK(write_file(files, json_of(folder),
                            json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"));
  return write_file(files, csv_of(folder), csv);
}

Status write_units(FileSystem& files, const std::string& folder,
                   const std::vector<UnitNeeds>& units) {
  return write_file(files, units_of(folder), units_csv(units));
}

}  // namespace sixpoint::repair
