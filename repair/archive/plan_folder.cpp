#include "repair/archive_plan.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "repair/archive_json.h"
#include "repair/archive_scripts.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kSchema = "sixpoint/archive-plan/";
constexpr int kVersion = 1;
constexpr std::uint64_t kUsualShardBytes = 4ULL << 30;
// What a file costs beside its bytes: opening, the mark, two syncs.
constexpr std::uint64_t kBytesPerFile = 64ULL << 10;
// Sizes above this count as this: a million sparse files must not overflow a sum.
constexpr std::uint64_t kLargestFile = 1ULL << 40;
constexpr std::uint64_t kLargestPlan = 256ULL << 20;
constexpr std::uint64_t kLargestManifest = 1ULL << 30;

std::string_view text_of(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

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
                     {"undo_rotation", repair.options.undo_rotation},
                     {"allow_prior", repair.options.allow_prior}};
  json["constants"] = repair.given ? calib::to_json(*repair.given) : Json(nullptr);
  json["calibration_file"] = repair.calibration_file
                                 ? Json{{"path", encode_path(repair.calibration_file->path)},
                                        {"sha256", repair.calibration_file->sha256}}
                                 : Json(nullptr);
  json["store"] = {{"location", encode_path(plan.store)}, {"sha256", plan.constants_sha256}};
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
  for (const Json& root : json.at("roots")) {
    SIXPOINT_ASSIGN(std::string path, decode_path(root.at("path").get<std::string>()));
    plan.roots.push_back({std::move(path), root.at("whole").get<bool>()});
  }
  const Json& options = json.at("options");
  plan.repair.options.wide = options.at("wide");
  plan.repair.options.undo_rotation = options.at("undo_rotation");
  plan.repair.options.allow_prior = options.at("allow_prior");
  if (const Json& given = json.at("constants"); !given.is_null()) {
    SIXPOINT_ASSIGN(plan.repair.given, calib::constants_record_from_json(given));
  }
  if (const Json& file = json.at("calibration_file"); !file.is_null()) {
    SIXPOINT_ASSIGN(std::string path, decode_path(file.at("path").get<std::string>()));
    plan.repair.calibration_file = {std::move(path), file.at("sha256").get<std::string>()};
  }
  SIXPOINT_ASSIGN(plan.store, decode_path(json.at("store").at("location").get<std::string>()));
  plan.constants_sha256 = json.at("store").at("sha256");
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
  if (!schema.starts_with(kSchema) || schema.size() > kSchema.size() + 6) {
    return std::nullopt;
  }
  int version = 0;
  for (const char c : schema.substr(kSchema.size())) {
    if (c < '0' || c > '9') {
      return std::nullopt;
    }
    version = version * 10 + (c - '0');
  }
  return version;
}

// How many shards a list of files makes when none may hold more than `most` (but for one file).
std::size_t shards_within(const std::vector<std::uint64_t>& bytes, std::uint64_t most) {
  std::size_t shards = 0;
  std::uint64_t left = 0;
  for (const std::uint64_t size : bytes) {
    if (shards == 0 || size > left) {
      ++shards;
      left = std::max(most, size);
    }
    left -= size;
  }
  return shards;
}

class Planner {
 public:
  Planner(Env& env, const ArchiveDraft& draft) : env_(env), draft_(draft) {}

  Result<PlannedArchive> make() {
    ArchivePlan& plan = made_.plan;
    plan.made_at = env_.clock.now();
    plan.software = draft_.software;
    plan.repair = draft_.repair;
    plan.store = draft_.store;
    for (const std::string& path : draft_.paths) {
      SIXPOINT_CHECK(add(path));
    }
    if (made_.files.empty()) {
      return fail(ErrorCode::no_input, "there is no .gt3x file to mend", draft_.paths.front(),
                  "name the folder with your recordings");
    }
    if (draft_.hash) {
      SIXPOINT_CHECK(hash());
    }
    SIXPOINT_CHECK(cut());
    return std::move(made_);
  }

 private:
  Status add(const std::string& path) {
    SIXPOINT_ASSIGN(const auto info, env_.files.info(path));
    SIXPOINT_ASSIGN(auto tree, find_files(env_.files, path, {{".gt3x"}, /*follow_out=*/false}));
    made_.not_followed.insert(made_.not_followed.end(), tree.not_followed.begin(),
                              tree.not_followed.end());
    made_.plan.refused.insert(made_.plan.refused.end(), tree.refused.begin(), tree.refused.end());
    const std::size_t root = root_of({info.is_folder ? path : folder_of(path), info.is_folder});
    for (FoundFile& file : tree.files) {
      const auto [other, fresh] = taken_.emplace(file.relative, file.path);
      if (!fresh) {
        made_.plan.refused.push_back(
            {file.path,
             Error{ErrorCode::cannot_create,
                   fmt::format("{} would have the same name in the output folder",
                               printable(other->second)),
                   file.path, "make separate plans of the two, with separate output folders"}});
        continue;
      }
      made_.files.push_back({root, std::move(file.relative), file.size, file.modified_ns, ""});
    }
    return {};
  }

  std::size_t root_of(ArchiveRoot root) {
    const auto [known, fresh] =
        roots_.emplace(std::pair(root.path, root.whole), made_.plan.roots.size());
    if (fresh) {
      made_.plan.roots.push_back(std::move(root));
    }
    return known->second;
  }

  Status hash() {
    std::size_t done = 0;
    std::vector<ArchiveFile> readable;
    for (ArchiveFile& file : made_.files) {
      draft_.progress(done++, made_.files.size());
      auto digest = file_sha256(env_.files, made_.plan.input_of(file));
      if (!digest) {
        made_.plan.refused.push_back({made_.plan.input_of(file), digest.error()});
        continue;
      }
      file.sha256 = *std::move(digest);
      readable.push_back(std::move(file));
    }
    made_.files = std::move(readable);
    if (made_.files.empty()) {
      return fail(made_.plan.refused.front().error);
    }
    return {};
  }

  Status cut() {
    std::vector<std::uint64_t> bytes;
    bytes.reserve(made_.files.size());
    for (const ArchiveFile& file : made_.files) {
      bytes.push_back(std::min(file.size, kLargestFile) + kBytesPerFile);
    }
    std::size_t shards = draft_.shards;
    if (shards == 0) {
      const std::uint64_t most = draft_.shard_bytes > 0 ? draft_.shard_bytes : kUsualShardBytes;
      shards = shards_within(bytes, most);
      if (draft_.shard_bytes == 0) {
        shards = std::min(shards, kUsualMostShards);
      }
    }
    shards = std::min(shards, made_.files.size());
    if (shards > kMostShards) {
      return fail(
          ErrorCode::usage,
          fmt::format("{} shards are more than the {} that a plan may have", shards, kMostShards),
          {}, "choose fewer or larger ones");
    }
    std::size_t from = 0;
    for (const std::size_t to : cut_into_shards(bytes, shards)) {
      const auto shard_files = std::span(made_.files).subspan(from, to - from);
      ArchiveShard shard;
      shard.files = shard_files.size();
      for (const ArchiveFile& file : shard_files) {
        shard.bytes += file.size;
      }
      made_.plan.shards.push_back(shard);
      from = to;
    }
    return {};
  }

  Env& env_;
  const ArchiveDraft& draft_;
  PlannedArchive made_;
  std::map<std::pair<std::string, bool>, std::size_t> roots_;
  std::map<std::string, std::string> taken_;  // output -> input
};

Result<ArchiveFile> file_of(std::string_view line, const ArchivePlan& plan) {
  const Json json = Json::parse(line, nullptr, false);
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

}  // namespace

std::size_t ArchivePlan::files() const {
  return std::accumulate(
      shards.begin(), shards.end(), std::size_t{0},
      [](std::size_t sum, const ArchiveShard& shard) { return sum + shard.files; });
}

std::uint64_t ArchivePlan::bytes() const {
  return std::accumulate(
      shards.begin(), shards.end(), std::uint64_t{0},
      [](std::uint64_t sum, const ArchiveShard& shard) { return sum + shard.bytes; });
}

std::string encode_path(std::string_view path) {
  std::string text;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte > 0x7e || c == '%') {
      text += fmt::format("%{:02X}", byte);
    } else {
      text += c;
    }
  }
  return text;
}

Result<std::string> decode_path(std::string_view text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9' ? c - '0' : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
  };
  std::string path;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      path += text[i];
      continue;
    }
    const int high = i + 2 < text.size() ? digit(text[i + 1]) : -1;
    const int low = i + 2 < text.size() ? digit(text[i + 2]) : -1;
    if (high < 0 || low < 0) {
      return fail(ErrorCode::bad_data, "a file name of the plan is damaged",
                  std::string(text.substr(0, 200)), "make the plan anew");
    }
    path += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return path;
}

std::vector<std::size_t> cut_into_shards(const std::vector<std::uint64_t>& bytes,
                                         std::size_t shards) {
  shards = std::min(shards, bytes.size());
  std::vector<std::size_t> ends;
  if (shards == 0) {
    return ends;
  }
  // The smallest size of the largest shard, by bisection.
  std::uint64_t low = *std::max_element(bytes.begin(), bytes.end());
  std::uint64_t high = std::accumulate(bytes.begin(), bytes.end(), std::uint64_t{0});
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (shards_within(bytes, middle) <= shards) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const bool full = sum + bytes[i] > low;
    // As many files left as shards: one each, so that none is empty.
    const bool spread = bytes.size() - i <= shards - ends.size() - 1;
    if ((full || spread) && i > (ends.empty() ? 0 : ends.back())) {
      ends.push_back(i);
      sum = 0;
    }
    sum += bytes[i];
  }
  ends.push_back(bytes.size());
  return ends;
}

Result<PlannedArchive> plan_archive(Env& env, const ArchiveDraft& draft) {
  return Planner(env, draft).make();
}

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
    shard.manifest_sha256 = hash_of(manifest);
    SIXPOINT_CHECK(write_file(files, folder + "/" + manifest_name(k), manifest));
    from += shard.files;
  }
  if (draft.snapshot != nullptr) {
    const std::string constants = draft.snapshot->to_json_lines();
    plan.constants_sha256 = hash_of(constants);
    SIXPOINT_CHECK(write_file(files, folder + "/constants.jsonl", constants));
  }
  const ArchiveScripts scripts{folder, draft.program, plan.shards.size(), draft.at_once};
  SIXPOINT_CHECK(write_file(files, folder + "/run.sbatch", slurm_script(scripts)));
  SIXPOINT_CHECK(write_file(files, folder + "/run_all.sh", shell_script(scripts)));
  Json json = to_json(plan);
  plan.id = hash_of(text_of(json));
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
  Json json = Json::parse(bytes->begin(), bytes->end(), nullptr, false);
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
  if (hash_of(text_of(json)) != id) {
    return fail(ErrorCode::configuration, "the plan was changed after it was made", path,
                "a plan is never changed: make another one");
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
  SIXPOINT_ASSIGN(const auto bytes, read_file(files, path, kLargestManifest));
  if (hash_of(text_of(bytes)) != plan.shards[shard].manifest_sha256) {
    return fail(ErrorCode::configuration, "the manifest was changed after the plan was made", path,
                "a plan is never changed: make another one");
  }
  std::vector<ArchiveFile> list;
  std::set<std::string> names;
  std::string_view text = text_of(bytes);
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
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
  SIXPOINT_ASSIGN(const auto bytes, read_file(files, path, kLargestManifest));
  if (hash_of(text_of(bytes)) != plan.constants_sha256) {
    return fail(ErrorCode::configuration, "the constants were changed after the plan was made",
                path, "a plan is never changed: make another one");
  }
  auto snapshot = ConstantsSnapshot::parse(text_of(bytes));
  if (!snapshot) {
    Error error = std::move(snapshot).error();
    error.where = path;
    return fail(std::move(error));
  }
  return std::optional(*std::move(snapshot));
}

}  // namespace sixpoint::repair
