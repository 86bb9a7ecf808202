#include "repair/batch/manifest.h"

#include <map>
#include <optional>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/text/csv_field.h"
#include "base/text/json_text.h"
#include "db/records.h"
#include "repair/rescale/output_place.h"

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

// One name for one file in the lines of all runs.
std::string name_of(FileSystem& files, const std::string& path) {
  return db::storable_path(place_of(files, path));
}

// An escaped name cannot be looked up: its line stays.
bool may_be_there(FileSystem& files, const std::string& name) {
  return files.link_info(name).has_value() || name.find("\\x") != std::string::npos;
}

Json entry_of(FileSystem& files, const RepairReport& report) {
  const Json all = report.to_json();
  Json entry = {{"input", name_of(files, report.input)}, {"output", nullptr}};
  if (!report.output.empty()) {
    entry["output"] = name_of(files, report.output);
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

KnownOutputs::KnownOutputs(FileSystem& files, const std::string& folder) : files_(files) {
  const Json json = manifest_in(files, folder);
  const auto text = [](const Json& object, const char* key) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  const auto as_of = parse_iso8601(text(json, "made_at"));
  if (!as_of) {
    return;
  }
  for (const Json& entry : json.value("files", Json::array())) {
    KnownOutput known{text(entry, "input_sha256"), text(entry, "output_sha256"), *as_of};
    if (!known.sha256.empty()) {
      known_.insert_or_assign(text(entry, "output"), std::move(known));
    }
  }
}

std::optional<KnownOutput> KnownOutputs::of(const std::string& output) const {
  if (known_.empty()) {
    return std::nullopt;
  }
  const auto found = known_.find(name_of(files_, output));
  return found == known_.end() ? std::nullopt : std::optional(found->second);
}

Status write_manifest(FileSystem& files, const std::string& folder,
                      const std::vector<RepairReport>& reports, UtcTime now,
                      const std::string& software) {
  std::vector<Json> lines;                         // of this run; null for what an earlier one says
  std::map<std::string, std::size_t> of_this_run;  // by input
  std::set<std::string> outputs;                   // of this run
  for (const RepairReport& report : reports) {
    const Json& line = lines.emplace_back(entry_of(files, report));
    of_this_run.emplace(line["input"].get<std::string>(), lines.size() - 1);
    if (line["output"].is_string()) {
      outputs.insert(line["output"].get<std::string>());
    }
  }
  Json entries = Json::array();
  const Json earlier = manifest_in(files, folder);
  for (const Json& entry : earlier.value("files", Json::array())) {
    const Json input = entry.is_object() ? entry.value("input", Json()) : Json();
    if (!input.is_string()) {
      continue;
    }
    const auto now_too = of_this_run.find(input.get<std::string>());
    const bool is_now_too = now_too != of_this_run.end();
    if (is_now_too) {
      if (auto kept = entry_of_earlier_output(reports[now_too->second], entry)) {
        lines[now_too->second] = nullptr;
        entries.push_back(*std::move(kept));
        continue;
      }
    }
    const Json output = entry.value("output", Json());
    const std::string name = output.is_string() ? output.get<std::string>() : std::string();
    const bool stays = !is_now_too || (!name.empty() && may_be_there(files, name));
    if (stays && !outputs.contains(name)) {
      entries.push_back(entry);
    }
  }
  for (Json& line : lines) {
    if (!line.is_null()) {
      entries.push_back(std::move(line));
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
