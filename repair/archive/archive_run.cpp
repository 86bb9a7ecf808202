#include "repair/archive_run.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "repair/archive_json.h"
#include "repair/archive_scripts.h"
#include "repair/constants_finder.h"

namespace sixpoint::repair {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kResultSchema = "sixpoint/archive-result/1";
constexpr std::uint64_t kLargestResult = 1ULL << 30;
// 'status' holds a shard's lock for a moment to see whether somebody else does.
constexpr int kLockAttempts = 40;
constexpr std::chrono::milliseconds kLockPause{50};

std::string results_of(const std::string& folder) { return folder + "/results"; }
std::string result_path(const std::string& folder, std::size_t shard) {
  return fmt::format("{}/results/{:05}.jsonl", folder, shard);
}
// A folder of their own: to list the one folder of all shards would cost every shard more the more
// there are.
std::string parts_folder(const std::string& folder, std::size_t shard) {
  return fmt::format("{}/results/{:05}.parts", folder, shard);
}
std::string lock_path(const std::string& folder, std::size_t shard) {
  return fmt::format("{}/results/{:05}.lock", folder, shard);
}

std::string line_of(std::size_t index, const RepairReport& report) {
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

std::optional<RepairStatus> status_of(const std::string& text) {
  for (const RepairStatus status :
       {RepairStatus::repaired, RepairStatus::not_affected, RepairStatus::not_repairable,
        RepairStatus::already_repaired, RepairStatus::failed}) {
    if (to_string(status) == text) {
      return status;
    }
  }
  return std::nullopt;
}

// What line_of() wrote; nlohmann's exceptions go to read_lines().
Result<RepairReport> report_of(const Json& json) {
  const Json& from = json.at("report");
  RepairReport report;
  const auto status = status_of(from.at("status").get<std::string>());
  if (!status) {
    return fail(ErrorCode::bad_data, "a status of no known kind");
  }
  report.status = *status;
  report.output = optional_of<std::string>(from.at("output")).value_or("");
  report.method = optional_of<std::string>(from.at("method")).value_or("");
  report.reasons = from.at("reasons").get<std::vector<std::string>>();
  report.serial = from.at("serial");
  report.samples = integer_of<std::uint64_t>(from.at("samples"));
  report.clipped_before = integer_of<std::uint64_t>(from.at("clipped_before"));
  report.clipped_after = integer_of<std::uint64_t>(from.at("clipped_after"));
  report.still_blocks = integer_of<std::size_t>(from.at("still_blocks"));
  report.still_error_before_mg = optional_of<double>(from.at("still_error_mg").at("before"));
  report.still_error_after_mg = optional_of<double>(from.at("still_error_mg").at("after"));
  report.rotation_undone = from.at("rotation_undone");
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

struct Lines {
  std::string output_folder;
  std::string software;
  std::vector<std::pair<std::size_t, RepairReport>> reports;
};

class Shard {
 public:
  static Result<Shard> open(FileSystem& files, const std::string& folder, const ArchivePlan& plan,
                            std::size_t number) {
    SIXPOINT_ASSIGN(auto manifest, read_manifest(files, folder, plan, number));
    return Shard(files, folder, plan, number, std::move(manifest));
  }

  const std::vector<ArchiveFile>& manifest() const { return manifest_; }
  std::string input_of(std::size_t i) const { return plan_->input_of(manifest_[i]); }

  Status write(const std::string& path, const Lines& lines) const {
    std::string body;
    for (const auto& [index, report] : lines.reports) {
      body += line_of(index, report);
    }
    const Json header = {
        {"schema", kResultSchema},    {"plan", plan_->id},
        {"shard", number_},           {"output_folder", encode_path(lines.output_folder)},
        {"software", lines.software}, {"files", lines.reports.size()},
        {"sha256", hash_of(body)}};
    return write_file(*files_, path,
                      header.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n" + body);
  }

  Result<Lines> read(const std::string& path) const {
    SIXPOINT_ASSIGN(const auto bytes, read_file(*files_, path, kLargestResult));
    try {
      auto lines =
          lines_of(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
      if (lines) {
        return lines;
      }
    } catch (const Json::exception&) {
      // Said below: what is missing makes no difference to the reader.
    }
    return fail(ErrorCode::bad_data, "the result is damaged or belongs to another plan", path,
                "run the shard again");
  }

  // Every file of the shard has its report.
  static bool is_whole(const Lines& lines, std::size_t files) {
    return lines.reports.size() == files;
  }

  Result<Lines> read_whole() const {
    SIXPOINT_ASSIGN(auto lines, read(result_path(folder_, number_)));
    if (!is_whole(lines, manifest_.size())) {
      return fail(ErrorCode::bad_data, "the result does not have all files of the shard",
                  result_path(folder_, number_), "run the shard again");
    }
    return lines;
  }

  // The parts of runs that did not come to their end, in the order in which they were written, and
  // temporary files of them (whose bytes no reader takes for a part).
  std::vector<std::string> parts() const {
    std::vector<std::string> paths;
    const auto names = files_->list(parts_folder(folder_, number_));
    if (names) {
      for (const std::string& name : *names) {
        paths.push_back(parts_folder(folder_, number_) + "/" + name);
      }
    }
    return paths;
  }

  // What earlier runs did, file by file.
  std::vector<std::optional<RepairReport>> known() const {
    std::vector<std::optional<RepairReport>> reports(manifest_.size());
    std::vector<std::string> paths = parts();
    paths.insert(paths.begin(), result_path(folder_, number_));
    for (const std::string& path : paths) {
      auto lines = read(path);
      if (!lines) {
        continue;  // damaged: its files are done again, and their outputs known by their marks
      }
      for (auto& [index, report] : lines->reports) {
        reports[index] = std::move(report);
      }
    }
    return reports;
  }

 private:
  Shard(FileSystem& files, std::string folder, const ArchivePlan& plan, std::size_t number,
        std::vector<ArchiveFile> manifest)
      : files_(&files),
        folder_(std::move(folder)),
        plan_(&plan),
        number_(number),
        manifest_(std::move(manifest)) {}

  Result<Lines> lines_of(std::string_view text) const {
    const std::string_view first = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), first.size() + 1));
    const Json header = Json::parse(first, nullptr, false);
    if (header.at("schema") != kResultSchema || header.at("plan") != plan_->id ||
        header.at("shard") != number_ || header.at("sha256") != hash_of(text)) {
      return fail(ErrorCode::bad_data, "another result");
    }
    Lines lines;
    SIXPOINT_ASSIGN(lines.output_folder,
                    decode_path(header.at("output_folder").get<std::string>()));
    lines.software = header.at("software");
    std::set<std::size_t> seen;
    while (!text.empty()) {
      const std::string_view line = text.substr(0, text.find('\n'));
      text.remove_prefix(std::min(text.size(), line.size() + 1));
      const Json json = Json::parse(line, nullptr, false);
      const auto index = integer_of<std::size_t>(json.at("file"));
      if (index >= manifest_.size() || !seen.insert(index).second) {
        return fail(ErrorCode::bad_data, "a file that is not in the shard");
      }
      SIXPOINT_ASSIGN(auto report, report_of(json));
      // JSON holds no bytes that are no UTF-8; the manifest does.
      report.input = input_of(index);
      if (!report.output.empty()) {
        report.output = lines.output_folder + "/" + manifest_[index].relative;
      }
      lines.reports.emplace_back(index, std::move(report));
    }
    return lines;
  }

  FileSystem* files_;
  std::string folder_;
  const ArchivePlan* plan_;
  std::size_t number_;
  std::vector<ArchiveFile> manifest_;
};

// The part of `path` that is there, without links, and the rest as it is written.
std::string real_place(FileSystem& files, const std::string& path) {
  if (auto real = files.real_path(path)) {
    return *std::move(real);
  }
  const std::string parent = folder_of(path);
  if (parent == path || parent == ".") {
    return path;
  }
  return real_place(files, parent) + "/" + file_name_of(path);
}

RepairReport failed(const std::string& input, Error error) {
  RepairReport report;
  report.input = input;
  report.reasons.push_back(error.brief());
  report.error = std::move(error);
  return report;
}

class ShardRun {
 public:
  ShardRun(Env& env, const std::string& folder, const ArchivePlan& plan,
           const ShardRunOptions& options)
      : env_(env), files_(env.files), folder_(folder), plan_(plan), options_(options) {}

  Result<ShardResult> run() {
    SIXPOINT_ASSIGN(const auto shard, Shard::open(files_, folder_, plan_, options_.shard));
    SIXPOINT_CHECK(check_output_folder());
    std::unique_ptr<FileLock> lock;
    if (!options_.dry_run) {
      SIXPOINT_CHECK(claim_output_folder());
      SIXPOINT_ASSIGN(lock, held(lock_path(folder_, options_.shard)));
      if (lock == nullptr) {
        return fail(ErrorCode::cannot_create,
                    fmt::format("shard {} is being mended by another run", options_.shard), folder_,
                    "wait for it; 'sixpoint archive status' says how far it is");
      }
    }
    SIXPOINT_CHECK(prepare_constants());
    ShardResult result;
    result.shard = options_.shard;
    result.output_folder = options_.output_folder;
    result.software = options_.software;
    SIXPOINT_CHECK(mend(shard, result));
    return result;
  }

 private:
  // Waits a little: who only looks whether a lock is held holds it for that moment.
  Result<std::unique_ptr<FileLock>> held(const std::string& path) {
    for (int attempt = 0;; ++attempt) {
      SIXPOINT_ASSIGN(auto lock, files_.lock(path));
      if (lock != nullptr || attempt == kLockAttempts) {
        return lock;
      }
      env_.clock.sleep(kLockPause);
    }
  }

  Status check_output_folder() {
    const std::string output = real_place(files_, options_.output_folder);
    for (const ArchiveRoot& root : plan_.roots) {
      const std::string archive = real_place(files_, root.path);
      if (root.whole && (is_inside(output, archive) || is_inside(archive, output))) {
        return fail(ErrorCode::usage,
                    fmt::format("the output folder and the archive {} lie in one another",
                                printable(root.path)),
                    options_.output_folder, "choose a folder apart from the archive");
      }
    }
    return {};
  }

  // The first run of any shard decides; all others must name the same folder.
  Status claim_output_folder() {
    SIXPOINT_ASSIGN(auto known, output_folder_of(files_, folder_));
    if (!known) {
      SIXPOINT_ASSIGN(const auto lock, held(results_of(folder_) + "/output.lock"));
      SIXPOINT_ASSIGN(known, output_folder_of(files_, folder_));
      if (!known) {
        const Json json = {{"schema", "sixpoint/archive-output/1"},
                           {"plan", plan_.id},
                           {"output_folder", encode_path(options_.output_folder)}};
        return write_file(files_, results_of(folder_) + "/output.json", json.dump() + "\n");
      }
    }
    if (*known != options_.output_folder) {
      return fail(
          ErrorCode::usage,
          fmt::format("the other shards of this plan are mended into {}", printable(*known)),
          options_.output_folder,
          fmt::format("use -o {}, or make another plan", shell_word(*known)));
    }
    return {};
  }

  Status prepare_constants() {
    SIXPOINT_ASSIGN(snapshot_, read_snapshot(files_, folder_, plan_));
    ConstantsFinderOptions finder;
    finder.given = plan_.repair.given;
    finder.snapshot = snapshot_ ? &*snapshot_ : nullptr;
    if (plan_.repair.calibration_file) {
      const ArchiveCalibrationFile& file = *plan_.repair.calibration_file;
      SIXPOINT_ASSIGN(const auto digest, file_sha256(files_, file.path));
      if (digest != file.sha256) {
        return fail(ErrorCode::configuration,
                    "the calibration file changed since the plan was made", file.path,
                    "put the old one back, or make another plan");
      }
      finder.calibration_file = file.path;
    }
    finder_.emplace(env_, std::move(finder));
    return {};
  }

  bool still_holds(const std::optional<RepairReport>& report) {
    if (!report || report->status == RepairStatus::failed) {
      return false;
    }
    return report->status != RepairStatus::repaired || files_.info(report->output).has_value();
  }

  Status mend(const Shard& shard, ShardResult& result) {
    std::vector<std::optional<RepairReport>> reports(shard.manifest().size());
    std::size_t done = 0;
    if (!options_.dry_run) {
      reports = shard.known();
      for (auto& report : reports) {
        if (still_holds(report)) {
          ++done;
        } else {
          report.reset();
        }
      }
    }
    result.done_before = done;
    Lines fresh{options_.output_folder, options_.software, {}};
    const bool nothing_to_do = done == reports.size();
    std::size_t next_part = number_after(shard.parts());
    auto since = env_.clock.elapsed();
    for (std::size_t i = 0; i < reports.size(); ++i) {
      if (reports[i]) {
        continue;
      }
      options_.progress(done, reports.size());
      reports[i] = mend_one(shard, i);
      ++done;
      fresh.reports.emplace_back(i, *reports[i]);
      if (!options_.dry_run && done < reports.size() &&
          (fresh.reports.size() >= options_.checkpoint_files ||
           env_.clock.elapsed() - since >= options_.checkpoint_after)) {
        SIXPOINT_CHECK(write_part(shard, next_part++, fresh));
        fresh.reports.clear();
        since = env_.clock.elapsed();
      }
    }
    options_.progress(done, reports.size());
    Lines all{options_.output_folder, options_.software, {}};
    for (std::size_t i = 0; i < reports.size(); ++i) {
      result.files.push_back(*reports[i]);
      all.reports.emplace_back(i, *std::move(reports[i]));
    }
    return options_.dry_run ? Status() : conclude(shard, all, nothing_to_do);
  }

  Status write_part(const Shard& shard, std::size_t number, const Lines& lines) {
    const std::string parts = parts_folder(folder_, options_.shard);
    SIXPOINT_CHECK(make_folder(parts));
    return shard.write(fmt::format("{}/{:06}.jsonl", parts, number), lines);
  }

  // The result, and then the parts away that it has made useless.
  Status conclude(const Shard& shard, const Lines& all, bool nothing_was_done) {
    const std::string path = result_path(folder_, options_.shard);
    if (!nothing_was_done || !shard.read_whole()) {
      AtomicFile::remove_left_over(files_, path);
      SIXPOINT_CHECK(shard.write(path, all));
    }
    const auto parts = shard.parts();
    for (const std::string& part : parts) {
      SIXPOINT_CHECK(files_.remove(part));
    }
    return parts.empty() ? Status() : files_.sync_folder(parts_folder(folder_, options_.shard));
  }

  static std::size_t number_after(const std::vector<std::string>& parts) {
    std::size_t number = 1;
    for (const std::string& path : parts) {
      std::size_t its = 0;
      for (const char c : file_name_of(path)) {
        if (c < '0' || c > '9' || its > 100'000'000) {
          break;
        }
        its = its * 10 + static_cast<std::size_t>(c - '0');
      }
      number = std::max(number, its + 1);
    }
    return number;
  }

  RepairReport mend_one(const Shard& shard, std::size_t i) {
    const ArchiveFile& planned = shard.manifest()[i];
    const std::string input = shard.input_of(i);
    const auto before = files_.info(input);
    if (!before) {
      Error error = before.error();
      if (error.code == ErrorCode::no_input) {
        error.what = "the file is gone since the plan was made: " + error.what;
      }
      return failed(input, std::move(error));
    }
    if (!is_as_planned(planned, input, *before)) {
      return failed(input, changed(input, "since the plan was made"));
    }
    const std::string output = options_.output_folder + "/" + planned.relative;
    if (!options_.dry_run) {
      if (const Status made = make_folder(folder_of(output)); !made) {
        return failed(input, made.error());
      }
      AtomicFile::remove_left_over(files_, output);
    }
    RepairOptions options = plan_.repair.options;
    options.dry_run = options_.dry_run;
    options.resume = true;
    RepairReport report = repair_file(env_, input, output, *finder_, options);
    const auto after = files_.info(input);
    const bool same = after && after->size == before->size &&
                      after->modified_ns == before->modified_ns && after->inode == before->inode;
    const bool same_hash = planned.sha256.empty() || report.input_sha256.empty() ||
                           report.input_sha256 == planned.sha256;
    if (report.status == RepairStatus::failed || (same && same_hash)) {
      return report;
    }
    // Half of it may be of the old file. What an earlier run made is not touched.
    if (!report.output.empty() && !report.resumed) {
      static_cast<void>(files_.remove(report.output));
    }
    return failed(input, changed(input, same ? "since the plan was made" : "while it was mended"));
  }

  bool is_as_planned(const ArchiveFile& planned, const std::string& input, const FileInfo& info) {
    if (info.is_folder || info.size != planned.size) {
      return false;
    }
    if (info.modified_ns == planned.modified_ns) {
      return true;
    }
    // A copy of the archive has other times; where there is a hash, the hash decides.
    const auto digest = planned.sha256.empty() ? "" : file_sha256(files_, input).value_or("");
    return !digest.empty() && digest == planned.sha256;
  }

  static Error changed(const std::string& input, const std::string& when) {
    return {ErrorCode::bad_data, "the file changed " + when, input,
            "see what changed it; a new plan takes it as it is now"};
  }

  Status make_folder(const std::string& folder) {
    if (made_.contains(folder)) {
      return {};
    }
    SIXPOINT_CHECK(make_synced_folders(files_, folder));
    made_.insert(folder);
    return {};
  }

  Env& env_;
  FileSystem& files_;
  const std::string& folder_;
  const ArchivePlan& plan_;
  const ShardRunOptions& options_;
  std::optional<ConstantsSnapshot> snapshot_;
  std::optional<ConstantsFinder> finder_;
  std::set<std::string> made_;
};

}  // namespace

std::string_view to_string(ShardState state) {
  switch (state) {
    case ShardState::done:
      return "done";
    case ShardState::running:
      return "running";
    case ShardState::partly:
      return "partly";
    case ShardState::missing:
      return "missing";
    case ShardState::damaged:
      return "damaged";
  }
  return "missing";
}

Result<ShardResult> run_shard(Env& env, const std::string& folder, const ArchivePlan& plan,
                              const ShardRunOptions& options) {
  return ShardRun(env, folder, plan, options).run();
}

Result<ShardResult> read_result(FileSystem& files, const std::string& folder,
                                const ArchivePlan& plan, std::size_t shard) {
  SIXPOINT_ASSIGN(const auto opened, Shard::open(files, folder, plan, shard));
  SIXPOINT_ASSIGN(auto lines, opened.read_whole());
  ShardResult result;
  result.shard = shard;
  result.output_folder = lines.output_folder;
  result.software = lines.software;
  std::sort(lines.reports.begin(), lines.reports.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  for (auto& [index, report] : lines.reports) {
    result.files.push_back(std::move(report));
  }
  return result;
}

ShardStanding standing_of(FileSystem& files, const std::string& folder, const ArchivePlan& plan,
                          std::size_t shard) {
  ShardStanding standing;
  const auto opened = Shard::open(files, folder, plan, shard);
  if (!opened) {
    standing.state = ShardState::damaged;
    return standing;
  }
  const auto known = opened->known();
  standing.files_done = static_cast<std::size_t>(
      std::count_if(known.begin(), known.end(), [](const auto& one) { return one.has_value(); }));
  if (files.info(lock_path(folder, shard))) {
    const auto lock = files.lock(lock_path(folder, shard));
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
  } else if (standing.files_done > 0) {
    standing.state = ShardState::partly;
  }
  return standing;
}

Result<std::optional<std::string>> output_folder_of(FileSystem& files, const std::string& folder) {
  const std::string path = results_of(folder) + "/output.json";
  const auto bytes = read_file(files, path, 1U << 20);
  if (!bytes) {
    if (bytes.error().code == ErrorCode::no_input) {
      return std::optional<std::string>();
    }
    return fail(bytes.error());
  }
  const Json json = Json::parse(bytes->begin(), bytes->end(), nullptr, false);
  if (!json.is_object() || !json.contains("output_folder") || !json["output_folder"].is_string()) {
    return fail(ErrorCode::bad_data, "the file that names the output folder is damaged", path,
                "remove it, and name the same folder again");
  }
  SIXPOINT_ASSIGN(std::string output, decode_path(json["output_folder"].get<std::string>()));
  return std::optional(std::move(output));
}

}  // namespace sixpoint::repair
