#include "repair/archive/plan_folder.h"

#include <charconv>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "base/text/json_text.h"
#include "repair/archive/archive_json.h"
#include "repair/archive/archive_scripts.h"
#include "repair/rescale/earlier_output.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kSchema = "sixpoint/archive-plan/";
constexpr int kVersion = 3;
constexpr std::uint64_t kLargestPlan = 256ULL << 20;
constexpr std::uint64_t kLargestManifest = 1ULL << 30;

std::string manifest_name(std::size_t shard) { return fmt::format("shards/{:05}.jsonl", shard); }

// A relative path that stays where it is put.
bool stays_below(std::string_view path) {
  if (path.empty() || path.find('\0') != std::string_view::npos) {
    return false;
  }
  while (true) {
    const auto slash = path.find('/');
    const std::string_view part = path.substr(0, slash);
    if (part.empty() || part == "." || part == "..") {
      return false;
    }
    if (slash == std::string_view::npos) {
      return true;
    }
    path.remove_prefix(slash + 1);
  }
}

std::string line_of(const ArchiveFile& file) {
  Json json = {{"root", file.root},
               {"path", encode_path(file.relative)},
               {"size", file.size},
               {"modified_ns", file.modified_ns}};
  if (!file.sha256.empty()) {
    json["sha256"] = file.sha256;
  }
  return json.dump() + "\n";
}

std::string manifest_of(std::span<const ArchiveFile> files) {
  std::string text;
  for (const ArchiveFile& file : files) {
    text += line_of(file);
  }
  return text;
}

// Everything but the id, which is the hash of this.
Json to_json(const ArchivePlan& plan) {
  Json json = {{"schema", fmt::format("{}{}", kSchema, kVersion)},
               {"made_at", to_iso8601(plan.made_at)},
               {"software", plan.software},
               {"files", plan.files()},
               {"bytes", plan.bytes()}};
  Json& roots = json["roots"] = Json::array();
  for (const ArchiveRoot& root : plan.roots) {
    roots.push_back({{"path", encode_path(root.path)}, {"whole", root.whole}});
  }
  const ArchiveRepair& repair = plan.repair;
  json["options"] = {{"wide", repair.options.wide},
                     {"store_only", repair.options.store_only},
                     {"undo_rotation", repair.options.undo_rotation},
                     {"allow_prior", repair.options.allow_prior},
                     {"force", repair.options.force},
                     {"link_unaffected", to_string(repair.link_unaffected)}};
  json["rules"] = kRepairRules;
  json["sources"] = {{"scan", repair.scan},
                     {"store_named", repair.store_named},
                     {"or_scan", repair.or_scan},
                     {"no_pool", repair.no_pool}};
  json["constants"] = repair.given ? calib::to_json(*repair.given) : Json(nullptr);
  json["calibration_file"] = repair.calibration_file
                                 ? Json{{"path", encode_path(repair.calibration_file->path)},
                                        {"sha256", repair.calibration_file->sha256}}
                                 : Json(nullptr);
  json["store"] = {{"location", encode_path(plan.store)}, {"sha256", plan.constants_sha256}};
  json["units"] = {{"sha256", plan.units_sha256}};
  Json& shards = json["shards"] = Json::array();
  for (const ArchiveShard& shard : plan.shards) {
    shards.push_back(
        {{"files", shard.files}, {"bytes", shard.bytes}, {"sha256", shard.manifest_sha256}});
  }
  Json& refused = json["refused"] = Json::array();
  for (const RefusedPath& path : plan.refused) {
    refused.push_back({{"path", encode_path(path.path)}, {"error", error_to_json(path.error)}});
  }
  return json;
}

std::string text_of(const Json& json) {
  return json.dump(1, ' ', false, Json::error_handler_t::replace);
}

// nlohmann's exceptions for a missing or wrong member go to read_plan().
Result<ArchivePlan> plan_of(const Json& json) {
  ArchivePlan plan;
  SIXPOINT_ASSIGN(plan.made_at, parse_iso8601(json.at("made_at").get<std::string>()));
  plan.software = json.at("software");
  static_cast<void>(json.at("rules"));  // read_plan() compared them
  for (const Json& root : json.at("roots")) {
    SIXPOINT_ASSIGN(std::string path, decode_path(root.at("path").get<std::string>()));
    plan.roots.push_back({std::move(path), root.at("whole").get<bool>()});
  }
  const Json& options = json.at("options");
  plan.repair.options.wide = options.at("wide");
  plan.repair.options.store_only = options.at("store_only");
  plan.repair.options.undo_rotation = options.at("undo_rotation");
  plan.repair.options.allow_prior = options.at("allow_prior");
  plan.repair.options.force = options.at("force");
  const auto link = parse_link_kind(options.at("link_unaffected").get<std::string>());
  if (!link) {
    return fail(ErrorCode::bad_data, "a kind of link that is none");
  }
  plan.repair.link_unaffected = *link;
  const Json& sources = json.at("sources");
  plan.repair.scan = sources.at("scan");
  plan.repair.store_named = sources.at("store_named");
  plan.repair.or_scan = sources.at("or_scan");
  plan.repair.no_pool = sources.at("no_pool");
  if (const Json& given = json.at("constants"); !given.is_null()) {
    SIXPOINT_ASSIGN(plan.repair.given, calib::constants_record_from_json(given));
  }
  if (const Json& file = json.at("calibration_file"); !file.is_null()) {
    SIXPOINT_ASSIGN(std::string path, decode_path(file.at("path").get<std::string>()));
    plan.repair.calibration_file = {std::move(path), file.at("sha256").get<std::string>()};
  }
  SIXPOINT_ASSIGN(plan.store, decode_path(json.at("store").at("location").get<std::string>()));
  plan.constants_sha256 = json.at("store").at("sha256");
  plan.units_sha256 = json.at("units").at("sha256");
  for (const Json& shard : json.at("shards")) {
    plan.shards.push_back({integer_of<std::size_t>(shard.at("files")),
                           integer_of<std::uint64_t>(shard.at("bytes")),
                           shard.at("sha256").get<std::string>()});
  }
  for (const Json& refused : json.at("refused")) {
    RefusedPath path;
    SIXPOINT_ASSIGN(path.path, decode_path(refused.at("path").get<std::string>()));
    SIXPOINT_ASSIGN(path.error, error_from_json(refused.at("error")));
    plan.refused.push_back(std::move(path));
  }
  return plan;
}

// "sixpoint/archive-plan/7" -> 7
std::optional<int> version_of(const Json& json) {
  if (!json.is_object() || !json.contains("schema") || !json["schema"].is_string()) {
    return std::nullopt;
  }
  const std::string schema = json["schema"];
  int version = 0;
  const char* end = schema.data() + schema.size();
  if (!schema.starts_with(kSchema) || schema.size() == kSchema.size() ||
      std::from_chars(schema.data() + kSchema.size(), end, version).ptr != end || version < 0) {
    return std::nullopt;
  }
  return version;
}

Result<ArchiveFile> file_of(std::string_view line, const ArchivePlan& plan) {
  const Json json = parse_json(line);
  ArchiveFile file;
  try {
    file.root = integer_of<std::size_t>(json.at("root"));
    SIXPOINT_ASSIGN(file.relative, decode_path(json.at("path").get<std::string>()));
    file.size = integer_of<std::uint64_t>(json.at("size"));
    file.modified_ns = integer_of<std::int64_t>(json.at("modified_ns"));
    file.sha256 = json.value("sha256", "");
  } catch (const Json::exception&) {
    return fail(ErrorCode::bad_data, "a line of the manifest is damaged", {}, "make the plan anew");
  }
  if (file.root >= plan.roots.size() || !stays_below(file.relative)) {
    return fail(ErrorCode::bad_data,
                fmt::format("the manifest names a file outside of the plan: {}",
                            printable(file.relative, 200)),
                {}, "do not run this plan; make it anew");
  }
  return file;
}

// A file that must be as the plan wrote it. `what`: "the manifest was".
Result<Bytes> read_unchanged(FileSystem& files, const std::string& path, std::string_view what,
                             const std::string& sha256) {
  SIXPOINT_ASSIGN(Bytes bytes, read_file(files, path, kLargestManifest));
  if (text_sha256(as_text(bytes)) != sha256) {
    return fail(ErrorCode::configuration, fmt::format("{} changed after the plan was made", what),
                path, "a plan is never changed: make another one");
  }
  return bytes;
}

}  // namespace

Status write_plan(Env& env, const std::string& folder, const ArchiveDraft& draft,
                  PlannedArchive& planned) {
  FileSystem& files = env.files;
  SIXPOINT_CHECK(make_synced_folders(files, folder));
  SIXPOINT_ASSIGN(const auto lock, files.lock(folder + "/plan.lock"));
  if (lock == nullptr || files.info(folder + "/plan.json")) {
    return fail(ErrorCode::cannot_create, "there is a plan already", folder,
                "choose another folder: a plan is never changed");
  }
  SIXPOINT_CHECK(make_synced_folders(files, folder + "/shards"));
  SIXPOINT_CHECK(make_synced_folders(files, folder + "/results"));
  ArchivePlan& plan = planned.plan;
  std::size_t from = 0;
  for (std::size_t k = 0; k < plan.shards.size(); ++k) {
    ArchiveShard& shard = plan.shards[k];
    const std::string manifest = manifest_of(std::span(planned.files).subspan(from, shard.files));
    shard.manifest_sha256 = text_sha256(manifest);
    SIXPOINT_CHECK(write_file(files, folder + "/" + manifest_name(k), manifest));
    from += shard.files;
  }
  if (draft.snapshot != nullptr) {
    const std::string constants = draft.snapshot->to_json_lines();
    plan.constants_sha256 = text_sha256(constants);
    SIXPOINT_CHECK(write_file(files, folder + "/constants.jsonl", constants));
  }
  if (planned.units) {
    const std::string units = planned.units->to_json_lines();
    plan.units_sha256 = text_sha256(units);
    SIXPOINT_CHECK(write_file(files, folder + "/units.jsonl", units));
  }
  const ArchiveScripts scripts{folder, draft.program, plan.shards.size(), draft.at_once,
                               plan.files()};
  SIXPOINT_CHECK(write_file(files, folder + "/run.sbatch", slurm_script(scripts)));
  SIXPOINT_CHECK(write_file(files, folder + "/merge.sbatch", merge_script(scripts)));
  SIXPOINT_CHECK(write_file(files, folder + "/run_all.sh", shell_script(scripts)));
  Json json = to_json(plan);
  plan.id = text_sha256(text_of(json));
  json["id"] = plan.id;
  return write_file(files, folder + "/plan.json", text_of(json) + "\n");
}

Result<ArchivePlan> read_plan(FileSystem& files, const std::string& folder) {
  const std::string path = folder + "/plan.json";
  auto bytes = read_file(files, path, kLargestPlan);
  if (!bytes) {
    Error error = std::move(bytes).error();
    if (error.code == ErrorCode::no_input) {
      error = {ErrorCode::no_input, "there is no plan in this folder", folder,
               "make one with 'sixpoint archive plan'"};
    }
    return fail(std::move(error));
  }
  Json json = parse_json(as_text(*bytes));
  const auto version = version_of(json);
  if (!version) {
    return fail(ErrorCode::bad_data, "this is no plan of an archive, or it is damaged", path,
                "make the plan anew");
  }
  if (*version != kVersion) {
    return fail(ErrorCode::configuration,
                fmt::format("the plan has version {}, this program reads {}", *version, kVersion),
                path, "run it with the version of sixpoint that made it");
  }
  const std::string id =
      json.contains("id") && json["id"].is_string() ? json["id"].get<std::string>() : "";
  json.erase("id");
  if (text_sha256(text_of(json)) != id) {
    return fail(ErrorCode::configuration, "the plan was changed after it was made", path,
                "a plan is never changed: make another one");
  }
  if (json.contains("rules") && json["rules"] != kRepairRules) {
    return fail(ErrorCode::configuration,
                "the plan was made for other rules of repair than this program has", path,
                "make another plan");
  }
  try {
    auto plan = plan_of(json);
    if (plan) {
      plan->id = id;
      return plan;
    }
  } catch (const Json::exception&) {
    // Said below: what is missing makes no difference to the reader.
  }
  return fail(ErrorCode::bad_data, "the plan is damaged", path, "make the plan anew");
}

Result<std::vector<ArchiveFile>> read_manifest(FileSystem& files, const std::string& folder,
                                               const ArchivePlan& plan, std::size_t shard) {
  if (shard >= plan.shards.size()) {
    return fail(ErrorCode::usage,
                fmt::format("there is no shard {}: this plan has {}, counted from 0", shard,
                            plan.shards.size()),
                folder, "see 'sixpoint archive status'");
  }
  const std::string path = folder + "/" + manifest_name(shard);
  SIXPOINT_ASSIGN(const auto bytes, read_unchanged(files, path, "the manifest was",
                                                   plan.shards[shard].manifest_sha256));
  std::vector<ArchiveFile> list;
  std::set<std::string> names;
  for (const std::string_view line : lines_of(as_text(bytes))) {
    auto file = file_of(line, plan);
    if (!file) {
      Error error = std::move(file).error();
      error.where = path;
      return fail(std::move(error));
    }
    if (!names.insert(file->relative).second) {
      return fail(ErrorCode::bad_data, "the manifest names an output twice", path,
                  "make the plan anew");
    }
    list.push_back(*std::move(file));
  }
  if (list.size() != plan.shards[shard].files) {
    return fail(ErrorCode::bad_data, "the manifest does not have the files that the plan counts",
                path, "make the plan anew");
  }
  return list;
}

Result<std::optional<ConstantsSnapshot>> read_snapshot(FileSystem& files, const std::string& folder,
                                                       const ArchivePlan& plan) {
  if (plan.constants_sha256.empty()) {
    return std::optional<ConstantsSnapshot>();
  }
  const std::string path = folder + "/constants.jsonl";
  SIXPOINT_ASSIGN(const auto bytes,
                  read_unchanged(files, path, "the constants were", plan.constants_sha256));
  auto snapshot = ConstantsSnapshot::parse(as_text(bytes));
  if (!snapshot) {
    Error error = std::move(snapshot).error();
    error.where = path;
    return fail(std::move(error));
  }
  return std::optional(*std::move(snapshot));
}

Result<std::optional<UnitAnswers>> read_units(FileSystem& files, const std::string& folder,
                                              const ArchivePlan& plan) {
  if (plan.units_sha256.empty()) {
    return std::optional<UnitAnswers>();
  }
  const std::string path = folder + "/units.jsonl";
  SIXPOINT_ASSIGN(const auto bytes,
                  read_unchanged(files, path, "the units' constants were", plan.units_sha256));
  auto units = UnitAnswers::parse(as_text(bytes));
  if (!units) {
    Error error = std::move(units).error();
    error.where = path;
    return fail(std::move(error));
  }
  return std::optional(*std::move(units));
}

}  // namespace sixpoint::repair
