// Many files repaired into one folder.
//
//   auto named = named_files(env.files, {"archive"}, {".gt3x"});
//   refuse_same_outputs(named.files, "repaired");
//   ConstantsFinder finder(env, {});
//   const auto reports = repair_files(env, named.files, {"repaired", {}, 0}, finder);
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "calib/constants.h"
#include "repair/batch/named_files.h"
#include "repair/rescale/repair_file.h"

namespace sixpoint::repair {

struct RepairFilesOptions {
  std::string folder;  // an output lies below it as its input lay below the folder that was named
  // `jobs` is set from the one below: with fewer files than threads a file gets several.
  // redo_outdated implies resume.
  RepairOptions repair;
  unsigned jobs = 0;  // files at a time; 0: one per core
};

// A report for each file, in their order, but for those that were not begun when `stop` was set.
// `watch(done)`: jobs.h.
std::vector<RepairReport> repair_files(
    Env& env, const std::vector<NamedFile>& files, const RepairFilesOptions& options,
    ConstantsSource& source, const std::function<void(std::size_t)>& watch = [](std::size_t) {},
    const std::atomic<bool>* stop = nullptr);

// The report of a file that could not be read at all.
RepairReport failed_report(const std::string& input, const Error& error);

// constants.json; errors name the file.
Result<calib::ConstantsRecord> read_constants(FileSystem& files, const std::string& path);

}  // namespace sixpoint::repair
