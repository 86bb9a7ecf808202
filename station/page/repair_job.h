// "Repair my files": mends a folder in the background and says how far it is.
//
// The same as `sixpoint repair FOLDER -o OUTPUT`, one file at a time, for the page. One job at a
// time. All functions may be called from any thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "db/store.h"
#include "repair/repair_file.h"

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

  // usage while another job is under way; no_input where the folder is not there.
  Status start(const RepairOrder& order);
  void cancel();
  // {state: none|running|done|cancelled|failed, done, total, current, summary{}, files[], error}
  nlohmann::ordered_json to_json() const;
  std::uint64_t changes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// What the store is told about a file that was mended.
db::RepairRecord repair_record_of(const repair::RepairReport& report, UtcTime made_at);

}  // namespace sixpoint::station
