#include "repair/batch/repair_files.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/bytes.h"
#include "base/text/json_keys.h"
#include "gt3x/recording.h"
#include "repair/batch/jobs.h"
#include "repair/batch/manifest.h"
#include "repair/rescale/output_place.h"
#include "repair/rescale/repair_mark.h"

namespace sixpoint::repair {
namespace {

constexpr std::uint64_t kNoFile = 0;  // as FileInfo has it where a file system has no inodes

class Run {
 public:
  Run(Env& env, const std::vector<NamedFile>& files, const RepairFilesOptions& options,
      ConstantsSource& source, UnitPool& pool, const RepairWatch& watch,
      const std::atomic<bool>* stop)
      : env_(env),
        files_(files),
        options_(options),
        source_(source),
        pool_(pool),
        watch_(watch),
        stop_(stop),
        known_(env.files, options.folder),
        answers_(files.size()) {}

  std::vector<RepairReport> run() {
    std::vector<std::size_t> all(files_.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    pass("repairing", all);
    const auto waiting = files_that_wait();
    if (stop_ != nullptr && *stop_) {
      forget(waiting);
    } else if (!waiting.empty()) {
      ask_units(waiting);
    }
    finish_unchecked();
    std::vector<RepairReport> reports;
    for (std::optional<RepairReport>& answer : answers_) {
      if (answer) {
        reports.push_back(*std::move(answer));
      }
    }
    return reports;
  }

 private:
  RepairReport repair_one(const NamedFile& file, RepairOptions how) {
    if (file.error) {
      ++failed_;
      return failed_report(file.path, *file.error);
    }
    const std::string output = options_.folder + "/" + file.relative;
    if (const auto status = check_output_place(env_.files, options_.folder, output); !status) {
      ++failed_;
      return failed_report(file.path, status.error());
    }
    how.known_output = known_.of(output);
    RepairReport report = repair_file(env_, file.path, output, source_, how);
    link_unaffected(env_.files, options_.make_link, options_.link, output, report);
    if (const auto info = env_.files.info(file.path)) {
      bytes_ += info->size;
    }
    failed_ += report.status == RepairStatus::failed ? 1 : 0;
    return report;
  }

  // With fewer files than --jobs a file gets several threads.
  RepairOptions options_of_file(std::size_t files) const {
    RepairOptions how = options_.repair;
    how.resume = how.resume || how.redo_outdated;
    how.leave_unchecked = files_.size() > 1;  // one file alone has no others to wait for
    const unsigned jobs = threads_of(options_.jobs);
    how.jobs = std::max(1U, jobs / static_cast<unsigned>(std::clamp<std::size_t>(files, 1, jobs)));
    return how;
  }

  void begin(const char* doing, std::size_t files) {
    bytes_ = 0;
    failed_ = 0;
    if (watch_.begin) {
      watch_.begin(doing, files);
    }
  }

  void at(std::size_t done) {
    if (watch_.at) {
      watch_.at({done, bytes_, failed_});
    }
  }

  // `refuted_by`: for each file, where the constants of unchecked ones were looked at; else empty.
  void pass(const char* doing, const std::vector<std::size_t>& which,
            const std::vector<std::string>& refuted_by = {}) {
    RepairOptions all = options_of_file(which.size());
    all.leave_unchecked = all.leave_unchecked && refuted_by.empty();
    begin(doing, which.size());
    for_each_job(
        which.size(), options_.jobs,
        [&](std::size_t k) {
          RepairOptions how = all;
          how.refuted_by = refuted_by.empty() ? "" : refuted_by[which[k]];
          RepairReport report = repair_one(files_[which[k]], std::move(how));
          if (watch_.did) {
            watch_.did(report);
          }
          answers_[which[k]] = std::move(report);
        },
        [&](std::size_t done) { at(done); }, stop_);
  }

  std::vector<std::size_t> files_that_wait() const {
    const auto paths = pool_.waiting();
    std::vector<std::size_t> waiting;
    for (std::size_t i = 0; i < files_.size(); ++i) {
      if (answers_[i] && std::ranges::binary_search(paths, files_[i].path)) {
        waiting.push_back(i);
      }
    }
    return waiting;
  }

  // What a stopped run did not decide is not done: the next one decides.
  void forget(const std::vector<std::size_t>& waiting) {
    for (const std::size_t i : waiting) {
      answers_[i].reset();
    }
  }

  // Files that need no repair, of units that lack constants.
  void ask_helpers() {
    const auto units = pool_.units_that_lack();
    std::vector<std::size_t> helpers;
    for (std::size_t i = 0; i < files_.size(); ++i) {
      if (answers_[i] && answers_[i]->status == RepairStatus::not_affected &&
          units.contains(answers_[i]->serial)) {
        helpers.push_back(i);
      }
    }
    if (helpers.empty()) {
      return;
    }
    begin("reading the units' other files", helpers.size());
    for_each_job(
        helpers.size(), options_.jobs,
        [&](std::size_t k) {
          collect_helper(env_.files, files_[helpers[k]].path, pool_, options_.repair.still);
        },
        [&](std::size_t done) { at(done); }, stop_);
  }

  void ask_units(const std::vector<std::size_t>& waiting) {
    ask_helpers();
    if (stop_ != nullptr && *stop_) {
      return forget(waiting);
    }
    pool_.close(env_.clock.now());
    std::vector<std::size_t> again;
    for (const std::size_t i : waiting) {
      if (pool_.has_constants(files_[i].path)) {
        again.push_back(i);
        answers_[i].reset();
      } else if (auto why = pool_.why_none(files_[i].path); !why.empty()) {
        answers_[i]->reasons.push_back(std::move(why));
        answers_[i]->for_a_person = answers_[i]->for_a_person || pool_.contradicts(files_[i].path);
      }
    }
    pass("repairing by the unit's other files", again);
  }

  // The first file of `report`'s unit that refutes its constants; empty for none.
  std::string refuted_by(const RepairReport& report) const {
    const auto refutes = [&](const std::optional<RepairReport>& other) {
      return other && other->refutes_constants && other->serial == report.serial && other->source &&
             report.source && other->source->id == report.source->id;
    };
    const auto found = std::ranges::find_if(answers_, refutes);
    return found == answers_.end() ? "" : (*found)->input;
  }

  // The files that no still periods of their own can check.
  void finish_unchecked() {
    std::vector<std::size_t> unchecked;
    for (std::size_t i = 0; i < answers_.size(); ++i) {
      if (answers_[i] && answers_[i]->waits_for_others) {
        unchecked.push_back(i);
      }
    }
    if (stop_ != nullptr && *stop_) {
      return forget(unchecked);
    }
    if (unchecked.empty()) {
      return;
    }
    std::vector<std::string> by(files_.size());
    for (const std::size_t i : unchecked) {
      by[i] = refuted_by(*answers_[i]);
    }
    forget(unchecked);
    pass("repairing files without still periods", unchecked, by);
  }

  Env& env_;
  const std::vector<NamedFile>& files_;
  const RepairFilesOptions& options_;
  ConstantsSource& source_;
  UnitPool& pool_;
  const RepairWatch& watch_;
  const std::atomic<bool>* stop_;
  const KnownOutputs known_;  // before this run
  std::vector<std::optional<RepairReport>> answers_;
  // Of the pass that runs.
  std::atomic<std::uint64_t> bytes_{0};
  std::atomic<std::size_t> failed_{0};
};

}  // namespace

Result<calib::ConstantsRecord> read_constants(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const auto bytes, read_file(files, path, 1U << 20));
  if (const auto doubled = doubled_json_key(as_text(bytes))) {
    return fail(ErrorCode::bad_data,
                fmt::format("the key {} stands twice", printable(*doubled, 200)), path,
                "remove the one that is wrong");
  }
  auto record = calib::parse_constants_record(as_text(bytes));
  if (!record) {
    Error error = record.error();
    error.where = path;
    return fail(std::move(error));
  }
  return record;
}

Status check_calibration_recording(FileSystem& files, const std::string& path) {
  const auto recording = gt3x::Recording::open(files, path);
  if (recording) {
    return {};
  }
  Error error = recording.error();
  if (path.ends_with(".json")) {
    error.hint = "a calibration file is a recording; constants in JSON are given by --constants";
  }
  return fail(std::move(error));
}

void leave_out_outputs(FileSystem& files, std::vector<NamedFile>& named,
                       const std::string& folder) {
  const auto output = files.real_path(folder);
  if (!output) {
    return;  // it is not there yet
  }
  const auto lies_in_output = [&](const NamedFile& file) {
    const std::string real = place_of(files, file.path);
    const std::string below = "/" + file.relative;
    if (file.error || !real.ends_with(below)) {
      return false;  // it, or a folder above it, is a link that leads out of the tree
    }
    const std::string tree = real.substr(0, real.size() - below.size());
    return tree != *output && is_inside(*output, tree) && is_inside(real, *output);
  };
  const auto which = [&](const NamedFile& file) {
    const auto info = files.info(file.path);
    return info ? std::pair(info->device, info->inode) : std::pair(kNoFile, kNoFile);
  };
  std::vector<bool> inside;
  std::set<std::pair<std::uint64_t, std::uint64_t>> inputs;  // device and inode
  for (const NamedFile& file : named) {
    inside.push_back(lies_in_output(file));
    if (!inside.back()) {
      inputs.insert(which(file));
    }
  }
  inputs.erase({kNoFile, kNoFile});
  std::vector<NamedFile> kept;
  for (std::size_t i = 0; i < named.size(); ++i) {
    NamedFile& file = named[i];
    if (inside[i] && (inputs.contains(which(file)) || mark_in(files, file.path))) {
      continue;
    }
    if (inside[i]) {
      file.error = Error{ErrorCode::cannot_create, "this recording lies in the output folder",
                         file.path, kFolderWithoutRecordings};
    }
    kept.push_back(std::move(file));
  }
  named = std::move(kept);
}

std::vector<RepairReport> repair_files(Env& env, const std::vector<NamedFile>& files,
                                       const RepairFilesOptions& options, ConstantsSource& source,
                                       UnitPool& pool, const RepairWatch& watch,
                                       const std::atomic<bool>* stop) {
  return Run(env, files, options, source, pool, watch, stop).run();
}

}  // namespace sixpoint::repair
