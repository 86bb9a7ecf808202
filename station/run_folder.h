// What a run under way has on the disk: its state after every step, and its samples as they came.
//
//   FOLDER/run.json       who, which unit, which poses are taken; written anew, whole, at each step
//   FOLDER/samples-1.csv  rows since the first sample; -2 and so on after each restart
//   FOLDER/capture.json   a calibration file under way: which sides are done, in which recordings
//
// A power cut loses at most the samples of the last second. One thread at a time.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/env.h"
#include "station/capture_run.h"
#include "station/jig_session.h"

namespace sixpoint::station {

// A run that an earlier program left.
struct UnfinishedRun {
  std::string device;
  std::string serial;
  std::string firmware;
  std::string operator_name;
  std::string station;
  std::string client;
  bool write = false;
  calib::FilterConfiguration filter = calib::FilterConfiguration::current;
  JigResume resume;
};

// A calibration file, likewise. Its samples are in the unit.
struct UnfinishedCapture {
  std::string serial;
  std::string operator_name;
  std::string client;
  std::string output;  // the .gt3x to make
  CaptureResume resume;
};

class RunFolder {
 public:
  RunFolder(Env& env, std::string folder) : env_(env), folder_(std::move(folder)) {}

  // Nothing where no run was left. bad_data where what is there does not hold together: it stays
  // for an engineer to look at.
  Result<std::optional<UnfinishedRun>> load();
  Status save(const UnfinishedRun& run);  // all but resume.raw_csv
  Status append(std::string_view rows);   // synced once a second
  Status close();                         // syncs what is open
  // The run is in the store: nothing of it is needed here any more.
  Status clear();
  Result<std::optional<UnfinishedCapture>> load_capture();  // as load()
  Status save_capture(const UnfinishedCapture& capture);
  Status clear_capture();
  // Puts what load() could not read out of the way, under a name with `.bad`.
  Status set_aside();

 private:
  Result<std::vector<std::string>> names() const;

  Env& env_;
  std::string folder_;
  std::unique_ptr<WritableFile> file_;
  std::uint64_t size_ = 0;
  std::chrono::nanoseconds synced_{0};
};

}  // namespace sixpoint::station
