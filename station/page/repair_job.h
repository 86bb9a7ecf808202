// "Repair my files": repairs a folder in the background and says how far it is.
//
//   RepairJob job(env, [&] { return db::Store::open(env, "plant.db"); });
//   SIXPOINT_CHECK(job.start({"/data/archive", "/data/repaired", ""}));
//   job.to_json();   // {"state": "running", "done": 3, "total": 12, ...}
//
// The same as `sixpoint repair FOLDER -o OUTPUT --resume`, one file at a time, for the page: the
// same lock of the output folder, the same manifest in it (repair/batch/manifest.h), and the same
// rows in the store (repair/rescale/repair_records.h). One job at a time. All functions may be
// called from any thread.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "db/store.h"

namespace sixpoint::station {

struct RepairOrder {
  std::string folder;  // or one file
  std::string output;  // made where it is not there
  // Constants from this calibration file instead of the store; may be empty.
  std::string calibration_file;
};

using StoreOpener = std::function<Result<db::Store>()>;

class RepairJob {
 public:
  // `env` outlives the job. `open_store` is called on the job's own thread.
  RepairJob(Env& env, StoreOpener open_store);
  ~RepairJob();  // ends after the file under way
  RepairJob(const RepairJob&) = delete;
  RepairJob& operator=(const RepairJob&) = delete;

  // Everything that can be said before the work is said here: usage while another job is under way;
  // no_input where the folder or the calibration file is not there, or no recording is in the
  // folder; bad_data where the calibration file is no recording; cannot_create where another run is
  // repairing into the output folder, where that is a file, or where a manifest in it is not ours.
  Status start(const RepairOrder& order);
  void cancel();
  // {state: none|running|done|cancelled|failed, done, total, current, summary{}, files[], error}
  // While it runs, files and summary are those of the first pass: a file that waits for the other
  // files of its unit has its final answer at the end.
  nlohmann::ordered_json to_json() const;
  std::uint64_t changes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::station
