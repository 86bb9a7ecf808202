// Many files repaired into one folder.
//
//   auto named = named_files(env.files, {"archive"}, {".gt3x"});
//   leave_out_outputs(env.files, named.files, "repaired");
//   refuse_same_outputs(named.files, "repaired");
//   UnitPool pool;
//   ConstantsFinderOptions sources;
//   sources.unit = &pool;
//   ConstantsFinder finder(env, sources);
//   RepairFilesOptions options;
//   options.folder = "repaired";
//   const auto reports = repair_files(env, named.files, options, finder, pool);
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "calib/constants.h"
#include "repair/archive/link_unaffected.h"
#include "repair/batch/named_files.h"
#include "repair/rescale/repair_file.h"
#include "repair/units/unit_pool.h"

namespace sixpoint::repair {

struct RepairFilesOptions {
  std::string folder;  // an output lies below it as its input lay below the folder that was named
  // `jobs` is set from the one below: with fewer files than threads a file gets several.
  // redo_outdated implies resume.
  RepairOptions repair;
  unsigned jobs = 0;  // files at a time; 0: one per core
  // Files that need no repair get a name in the folder too (repair/archive/link_unaffected.h).
  LinkKind link = LinkKind::none;
  LinkMaker make_link;
};

// `begin` and `at` are called on the calling thread; each may be empty.
struct RepairWatch {
  std::function<void(const char* doing, std::size_t files)> begin;  // a pass over so many files
  std::function<void(const RepairProgress&)> at;                    // as jobs.h calls
  // Each file's report, on the thread that made it, once in each pass; may add reasons to it.
  std::function<void(RepairReport&)> did;
};

// An output folder that lies in a tree that was named. What was found in it is no input:
//
// | recording in the output folder                         | becomes of it                       |
// |--------------------------------------------------------|-------------------------------------|
// | has the mark of a repair or of a salvage               | left out: an earlier run wrote it   |
// | another name of an input that lies elsewhere           | left out: a link (--link-unaffected)|
// | otherwise                                              | refused: it gets an error           |
//
// Where the output folder does not lie in the tree, or is the tree, all files stay inputs.
void leave_out_outputs(FileSystem& files, std::vector<NamedFile>& named, const std::string& folder);

// Every file by itself, then those that wait for the other files of their unit, which `pool`
// collected: the source asks it. Last those without still periods, which the gate cannot check:
// what the others of the unit say against the same constants holds for them (gate.h, refutes()), so
// that neither order nor jobs decide. A report for each file, in their order, but for those that
// were not done when `stop` was set.
std::vector<RepairReport> repair_files(Env& env, const std::vector<NamedFile>& files,
                                       const RepairFilesOptions& options, ConstantsSource& source,
                                       UnitPool& pool, const RepairWatch& watch = {},
                                       const std::atomic<bool>* stop = nullptr);

// constants.json; errors name the file.
Result<calib::ConstantsRecord> read_constants(FileSystem& files, const std::string& path);

// That a calibration file is a recording, before the work begins.
Status check_calibration_recording(FileSystem& files, const std::string& path);

}  // namespace sixpoint::repair
