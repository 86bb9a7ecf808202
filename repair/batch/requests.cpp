#include "repair/batch/requests.h"

#include <cstdint>
#include <mutex>
#include <optional>

#include <fmt/format.h>

#include "base/text/json_text.h"
#include "db/store.h"
#include "repair/archive/output_lock.h"
#include "repair/batch/jobs.h"
#include "repair/batch/named_files.h"
#include "repair/batch/repair_files.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/known_calibration.h"
#include "repair/units/unit_needs.h"

namespace sixpoint::repair {
namespace {

// Takes the values of a JSON object one by one; what is left over at the end is an error.
class Options {
 public:
  explicit Options(Json json) : json_(std::move(json)) {
    if (!json_.is_object()) {
      refuse("the options are no JSON object");
    }
  }

  template <class Value>
  void take(const char* name, Value& value) {
    if (!json_.is_object() || !json_.contains(name)) {
      return;
    }
    const Json& given = json_[name];
    if constexpr (std::is_same_v<Value, unsigned>) {
      // Threads: there is no other whole number among the options.
      if (given.is_number_unsigned() && given.get<std::uint64_t>() <= kMostJobs) {
        value = given.get<unsigned>();
      } else {
        refuse(fmt::format("the option {} is no whole number from 0 to {}", name, kMostJobs));
      }
    } else if (std::is_same_v<Value, bool> ? given.is_boolean() : given.is_string()) {
      value = given.get<Value>();
    } else {
      refuse(fmt::format("the option {} has a value of another type", name));
    }
    json_.erase(name);
  }

  void take(const char* name, LinkKind& value) {
    std::string text;
    take(name, text);
    const auto kind = parse_link_kind(text);
    if (kind && kind != LinkKind::none) {
      value = *kind;
    } else if (!text.empty()) {
      refuse(fmt::format("the option {} is neither hard nor symbolic", name));
    }
  }

  Status done() {
    if (!refused_ && !json_.empty()) {
      refuse(fmt::format("there is no option {}", json_.begin().key()));
    }
    return refused_ ? Status(fail(*refused_)) : Status();
  }

 private:
  void refuse(std::string what) {
    refused_ = Error{ErrorCode::usage, std::move(what), {}, "see the documentation of the package"};
  }

  Json json_;
  std::optional<Error> refused_;
};

// Dates of calibration that a store knows; from any thread.
class KnownDates {
 public:
  explicit KnownDates(std::optional<db::Store> store) : store_(std::move(store)) {}

  KnownDate of(const std::string& serial) {
    if (!store_) {
      return {};
    }
    const std::scoped_lock lock(mutex_);
    const auto history = store_->unit_history(serial);
    return history ? calibration_date(*history) : KnownDate{std::nullopt, history.error().brief()};
  }

 private:
  std::mutex mutex_;
  std::optional<db::Store> store_;
};

Result<std::optional<db::Store>> store_to_read(Env& env, const std::string& location) {
  if (location.empty()) {
    return std::nullopt;
  }
  SIXPOINT_ASSIGN(auto store, db::Store::open_to_read(env, location));
  return store;
}

}  // namespace

Status take_options(std::string_view json, ScanRequest& request) {
  return take_parsed_options(parse_json(json), request);
}

Status take_options(std::string_view json, RepairRequest& request) {
  return take_parsed_options(parse_json(json), request);
}

Status take_parsed_options(Json json, ScanRequest& request) {
  Options options(std::move(json));
  options.take("jobs", request.jobs);
  options.take("store", request.store);
  return options.done();
}

Status take_parsed_options(Json json, RepairRequest& request) {
  Options options(std::move(json));
  options.take("jobs", request.jobs);
  for (const auto& [name, text] : {std::pair("constants", &request.constants),
                                   {"calibration_file", &request.calibration_file},
                                   {"store", &request.store}}) {
    options.take(name, *text);
  }
  RepairOptions& how = request.repair;
  for (const auto& [name, flag] : {std::pair("scan", &request.scan),
                                   {"or_scan", &request.or_scan},
                                   {"no_pool", &request.no_pool},
                                   {"wide", &how.wide},
                                   {"store_only", &how.store_only},
                                   {"undo_rotation", &how.undo_rotation},
                                   {"allow_prior", &how.allow_prior},
                                   {"salvage", &how.salvage},
                                   {"force", &how.force},
                                   {"dry_run", &how.dry_run},
                                   {"resume", &how.resume},
                                   {"redo_outdated", &how.redo_outdated}}) {
    options.take(name, *flag);
  }
  options.take("link_unaffected", request.link_unaffected);
  return options.done();
}

Result<Json> run_scan(Env& env, const ScanRequest& request, const Watching& watching) {
  SIXPOINT_ASSIGN(auto store, store_to_read(env, request.store));
  KnownDates dates(std::move(store));
  const auto lookup = [&](const std::string& serial) { return dates.of(serial); };
  const auto named = named_files(env.files, request.paths, {".gt3x", ".agdc", ".agd"}).files;
  std::vector<ScannedFile> scanned(named.size());
  const auto scan_one = [&](std::size_t i) {
    scanned[i] = named[i].error ? unreadable_file(named[i].path, *named[i].error)
                                : scan_file(env.files, named[i].path, lookup);
  };
  for_each_job(named.size(), request.jobs, scan_one, watching.watch, watching.stop);
  if (watching.stop != nullptr && *watching.stop) {
    return fail(ErrorCode::io, "it was stopped", {}, "run it again");
  }
  UnitTable table;
  Json json;
  json["files"] = Json::array();
  for (const ScannedFile& file : scanned) {
    table.add(file);
    json["files"].push_back(scanned_to_json(file));
  }
  json["summary"] = scan_summary(scanned);
  json["units"] = units_json(table.rows());
  return json;
}

Result<Json> run_repair(Env& env, const RepairRequest& request, const Watching& watching) {
  ConstantsFinderOptions how;
  how.still = request.repair.still;
  how.scan = request.scan;
  how.or_scan = request.or_scan;
  how.store_named = !request.store.empty();
  how.allow_prior = request.repair.allow_prior;
  if (!request.constants.empty()) {
    SIXPOINT_ASSIGN(how.given, read_constants(env.files, request.constants));
  }
  SIXPOINT_ASSIGN(auto store, store_to_read(env, request.store));
  how.store = store ? &*store : nullptr;
  if (!request.calibration_file.empty()) {
    SIXPOINT_CHECK(check_calibration_recording(env.files, request.calibration_file));
    how.calibration_file = request.calibration_file;
  }
  UnitPool pool;
  how.unit = request.no_pool ? nullptr : &pool;
  UnitTable table(sources_in_order(how));
  ConstantsFinder finder(env, std::move(how));
  std::unique_ptr<FileLock> lock;
  if (!request.repair.dry_run) {
    SIXPOINT_ASSIGN(lock, lock_for_repair(env.files, request.folder, request.paths));
  }
  auto named = named_files(env.files, request.paths, {".gt3x"}).files;
  leave_out_outputs(env.files, named, request.folder);
  refuse_same_outputs(named, request.folder);
  RepairFilesOptions options;
  options.folder = request.folder;
  options.repair = request.repair;
  options.jobs = request.jobs;
  options.link = request.link_unaffected;
  options.make_link = link_file;
  const auto reports = repair_files(
      env, named, options, finder, pool,
      {{}, [&](const RepairProgress& done) { watching.watch(done.files); }, {}}, watching.stop);
  Json json;
  json["files"] = Json::array();
  for (const RepairReport& report : reports) {
    table.add(report);
    json["files"].push_back(report.to_json());
  }
  json["summary"] = repair_summary(count_by_status(reports), request.repair.dry_run);
  json["units"] = units_json(table.rows());
  return json;
}

}  // namespace sixpoint::repair
