// A whole scan or repair by one call, as the packages of other languages ask for it: options in,
// the document of the command out.
//
//   RepairRequest request;
//   request.paths = {"archive"};
//   request.folder = "repaired";
//   SIXPOINT_CHECK(take_options(R"({"scan": true, "jobs": 2})", request));
//   SIXPOINT_ASSIGN(const Json answer, run_repair(env, request));
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/env.h"
#include "repair/archive/link_file.h"
#include "repair/batch/answers.h"

namespace sixpoint::repair {

struct ScanRequest {
  std::vector<std::string> paths;  // files and folders
  std::string store;               // that knows dates of calibration; empty: none
  unsigned jobs = 0;
};

struct RepairRequest {
  std::vector<std::string> paths;
  std::string folder;  // for repaired files
  // Where constants come from, as repair/rescale/sources.h. A store that is not named is not used,
  // and one that is named is only read.
  std::string constants;
  std::string calibration_file;
  std::string store;
  bool scan = false;
  bool or_scan = false;
  bool no_pool = false;  // do not ask the unit's other files
  RepairOptions repair;
  LinkKind link_unaffected = LinkKind::none;  // RepairFilesOptions::link
  unsigned jobs = 0;
};

// Sets what a JSON object names: {"jobs": 2, "store": "plant.db"}, for a repair also the other
// fields above (link_unaffected is "hard", "symbolic" or empty) and, of RepairOptions, wide,
// store_only, undo_rotation, allow_prior, salvage, force, dry_run, resume and redo_outdated. usage
// for a name that is none of these, for a value of another type, and for a number that is too large.
Status take_options(std::string_view json, ScanRequest& request);
Status take_options(std::string_view json, RepairRequest& request);
// The same of an object in memory, whose texts may hold bytes that are no UTF-8, as names of files do.
Status take_parsed_options(Json json, ScanRequest& request);
Status take_parsed_options(Json json, RepairRequest& request);

// On the calling thread `watch(done)` is called meanwhile (jobs.h); once `stop` is set, no further
// file is begun.
struct Watching {
  std::function<void(std::size_t)> watch = [](std::size_t) {};
  const std::atomic<bool>* stop = nullptr;
};

// {files, summary}. A file that cannot be read is an answer among the others; errors are those
// of the store and of what the options name, cannot_create where another run is repairing into the
// folder (repair/archive/output_lock.h), and io for a scan that was stopped (a repair that was
// stopped answers for what it has done).
Result<Json> run_scan(Env& env, const ScanRequest& request, const Watching& watching = {});
Result<Json> run_repair(Env& env, const RepairRequest& request, const Watching& watching = {});

}  // namespace sixpoint::repair
