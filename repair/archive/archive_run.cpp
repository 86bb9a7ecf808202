#include "repair/archive/archive_run.h"

#include <algorithm>
#include <charconv>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "base/text/json_text.h"
#include "repair/archive/archive_json.h"
#include "repair/archive/archive_scripts.h"
#include "repair/archive/output_lock.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/output_place.h"

namespace sixpoint::repair {
namespace {

// Results keep it: has_changed_since_plan() knows it again.
constexpr const char* kChangedSincePlan = "the file changed since the plan was made";
constexpr const char* kGoneSincePlan = "the file is gone since the plan was made: ";

using Json = nlohmann::ordered_json;

std::string results_of(const std::string& folder) { return folder + "/results"; }

class ShardRun {
 public:
  ShardRun(Env& env, const std::string& folder, const ArchivePlan& plan,
           const ShardRunOptions& options)
      : env_(env), files_(env.files), folder_(folder), plan_(plan), options_(options) {}

  Result<ShardResult> run() {
    SIXPOINT_ASSIGN(const auto shard, ShardFolder::open(files_, folder_, plan_, options_.shard));
    SIXPOINT_CHECK(check_output_folder());
    std::unique_ptr<FileLock> lock;
    std::unique_ptr<FileLock> output_lock;
    if (!options_.dry_run) {
      SIXPOINT_CHECK(claim_output_folder());
      SIXPOINT_ASSIGN(lock, wait_for_lock(env_, shard.lock_path()));
      if (lock == nullptr) {
        return fail(ErrorCode::cannot_create,
                    fmt::format("shard {} is being repaired by another run", options_.shard),
                    folder_, "wait for it; 'sixpoint archive status' says how far it is");
      }
      SIXPOINT_ASSIGN(output_lock,
                      lock_for_shard(env_, options_.output_folder, plan_.id, options_.shard));
    }
    SIXPOINT_CHECK(prepare_constants());
    ShardResult result;
    result.shard = options_.shard;
    result.output_folder = options_.output_folder;
    result.software = options_.software;
    SIXPOINT_CHECK(repair_files(shard, result));
    return result;
  }

 private:
  Status check_output_folder() {
    const std::string output = real_place(files_, options_.output_folder);
    for (const ArchiveRoot& root : plan_.roots) {
      const std::string archive = real_place(files_, root.path);
      const bool lie_in_one_another = is_inside(output, archive) || is_inside(archive, output);
      // Of the folder of files that were named, only they are archive: each would be its own output.
      if (root.whole ? lie_in_one_another : output == archive) {
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
      SIXPOINT_ASSIGN(const auto lock, wait_for_lock(env_, results_of(folder_) + "/output.lock"));
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
          fmt::format("the other shards of this plan are repaired into {}", printable(*known)),
          options_.output_folder,
          fmt::format("use -o {}, or make another plan", shell_word(*known)));
    }
    return {};
  }

  Status prepare_constants() {
    SIXPOINT_ASSIGN(snapshot_, read_snapshot(files_, folder_, plan_));
    ConstantsFinderOptions finder = finder_options(plan_.repair, snapshot_ ? &*snapshot_ : nullptr);
    SIXPOINT_ASSIGN(auto units, read_units(files_, folder_, plan_));
    if (units) {
      units_.emplace(*std::move(units));
      finder.unit = &*units_;
    }
    if (plan_.repair.calibration_file) {
      const ArchiveCalibrationFile& file = *plan_.repair.calibration_file;
      SIXPOINT_ASSIGN(const auto digest, file_sha256(files_, file.path));
      if (digest != file.sha256) {
        return fail(ErrorCode::configuration,
                    "the calibration file changed since the plan was made", file.path,
                    "put the old one back, or make another plan");
      }
    }
    finder_.emplace(env_, std::move(finder));
    return {};
  }

  bool still_holds(const std::optional<RepairReport>& report) {
    if (!report || report->status == RepairStatus::failed ||
        report->status == RepairStatus::outdated) {
      return false;
    }
    const std::string& made =
        report->status == RepairStatus::repaired ? report->output : report->linked;
    return made.empty() || files_.info(made).has_value();
  }

  // The reports of earlier runs that still hold.
  std::vector<std::optional<RepairReport>> done_before(const ShardFolder& shard) {
    std::vector<std::optional<RepairReport>> reports(shard.manifest().size());
    if (!options_.dry_run) {
      reports = shard.known();
      for (auto& report : reports) {
        if (!still_holds(report)) {
          report.reset();
        }
      }
    }
    return reports;
  }

  Status repair_files(const ShardFolder& shard, ShardResult& result) {
    auto reports = done_before(shard);
    RepairProgress done = progress_of(shard.manifest(), reports);
    result.done_before = done.files;
    ShardReports fresh{options_.output_folder, options_.software, {}};
    std::size_t next_part = number_after(shard.parts());
    auto since = env_.clock.elapsed();
    for (std::size_t i = 0; i < reports.size(); ++i) {
      if (reports[i]) {
        continue;
      }
      options_.progress(done, reports.size());
      if (options_.stop()) {
        result.stopped = true;
        break;
      }
      reports[i] = repair_one(shard, i);
      add_to(done, shard.manifest()[i], *reports[i]);
      fresh.reports.emplace_back(i, *reports[i]);
      if (!options_.dry_run && done.files < reports.size() &&
          (fresh.reports.size() >= options_.checkpoint_files ||
           env_.clock.elapsed() - since >= options_.checkpoint_after)) {
        SIXPOINT_CHECK(write_part(shard, next_part++, fresh));
        since = env_.clock.elapsed();
      }
    }
    options_.progress(done, reports.size());
    ShardReports all{options_.output_folder, options_.software, {}};
    for (std::size_t i = 0; i < reports.size(); ++i) {
      if (!reports[i]) {
        continue;  // stopped before it
      }
      result.files.push_back(*reports[i]);
      all.reports.emplace_back(i, *std::move(reports[i]));
    }
    const bool nothing_to_do = result.done_before == reports.size();
    if (options_.dry_run) {
      return {};
    }
    if (result.stopped) {
      return fresh.reports.empty() ? Status() : write_part(shard, next_part, fresh);
    }
    return conclude(shard, all, nothing_to_do);
  }

  Status write_part(const ShardFolder& shard, std::size_t number, ShardReports& fresh) {
    SIXPOINT_CHECK(make_folder(shard.parts_folder()));
    SIXPOINT_CHECK(shard.write(fmt::format("{}/{:06}.jsonl", shard.parts_folder(), number), fresh));
    fresh.reports.clear();
    return {};
  }

  // Writes the result, then removes the parts, which it contains.
  Status conclude(const ShardFolder& shard, const ShardReports& all, bool nothing_was_done) {
    if (!nothing_was_done || !shard.read_whole()) {
      AtomicFile::remove_left_over(files_, shard.result_path());
      SIXPOINT_CHECK(shard.write(shard.result_path(), all));
    }
    const auto parts = shard.parts();
    for (const std::string& part : parts) {
      SIXPOINT_CHECK(files_.remove(part));
    }
    if (!parts.empty()) {
      SIXPOINT_CHECK(files_.sync_folder(shard.parts_folder()));
    }
    if (files_.info(shard.parts_folder())) {
      static_cast<void>(files_.remove(shard.parts_folder()));  // empty: that it stays harms no one
    }
    return {};
  }

  static std::size_t number_after(const std::vector<std::string>& parts) {
    std::size_t number = 1;
    for (const std::string& path : parts) {
      const std::string name = file_name_of(path);
      std::size_t its = 0;
      std::from_chars(name.data(), name.data() + std::min<std::size_t>(name.size(), 9), its);
      number = std::max(number, its + 1);
    }
    return number;
  }

  RepairReport repair_one(const ShardFolder& shard, std::size_t i) {
    const ArchiveFile& planned = shard.manifest()[i];
    const std::string input = shard.input_of(i);
    const auto before = files_.info(input);
    if (!before) {
      Error error = before.error();
      if (error.code == ErrorCode::no_input) {
        error.what = kGoneSincePlan + error.what;
      }
      return failed_report(input, error);
    }
    const auto as_planned = is_as_planned(planned, input, *before);
    if (!as_planned || !*as_planned) {
      return failed_report(input, as_planned ? changed_since_plan(input) : as_planned.error());
    }
    const std::string output = options_.output_folder + "/" + planned.relative;
    if (const auto status = check_output_place(files_, options_.output_folder, output); !status) {
      return failed_report(input, status.error());
    }
    RepairOptions options = plan_.repair.options;
    options.dry_run = options_.dry_run;
    options.resume = true;
    options.redo_outdated = options_.redo_outdated;
    options.jobs = options_.threads;
    RepairReport report = repair_file(env_, input, output, *finder_, options);
    const bool same_hash = planned.sha256.empty() || report.input_sha256.empty() ||
                           report.input_sha256 == planned.sha256;
    if (report.status == RepairStatus::failed || same_hash) {
      link_unaffected(files_, options_.make_link, plan_.repair.link_unaffected, output, report);
      return report;
    }
    // What an earlier run made is not touched.
    if (!report.output.empty() && !report.resumed) {
      static_cast<void>(files_.remove(report.output));
    }
    return failed_report(input, changed_since_plan(input));
  }

  Result<bool> is_as_planned(const ArchiveFile& planned, const std::string& input,
                             const FileInfo& info) {
    if (info.is_folder || info.size != planned.size) {
      return false;
    }
    if (planned.sha256.empty()) {
      return info.modified_ns == planned.modified_ns;
    }
    // A copy of the archive has other times, and a file that was changed may have its old one.
    SIXPOINT_ASSIGN(const auto digest, file_sha256(files_, input));
    return digest == planned.sha256;
  }

  static Error changed_since_plan(const std::string& input) {
    return {ErrorCode::bad_data, kChangedSincePlan, input,
            "find out what changed it; a new plan takes it as it is now"};
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
  std::optional<KnownUnits> units_;
  std::optional<ConstantsFinder> finder_;
  std::set<std::string> made_;
};

}  // namespace

Result<ShardResult> run_shard(Env& env, const std::string& folder, const ArchivePlan& plan,
                              const ShardRunOptions& options) {
  return ShardRun(env, folder, plan, options).run();
}

bool has_changed_since_plan(const RepairReport& report) {
  return report.status == RepairStatus::failed && report.error &&
         (report.error->what == kChangedSincePlan ||
          report.error->what.starts_with(kGoneSincePlan));
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
  const Json json = parse_json(as_text(*bytes));
  if (!json.is_object() || !json.contains("output_folder") || !json["output_folder"].is_string()) {
    return fail(ErrorCode::bad_data, "the file that names the output folder is damaged", path,
                "remove it, and name the same folder again");
  }
  SIXPOINT_ASSIGN(std::string output, decode_path(json["output_folder"].get<std::string>()));
  return std::optional(std::move(output));
}

}  // namespace sixpoint::repair
