// A run under way on the disk: its state after every step, and its samples.
//
//   RunFolder folder(env, "state/lane-1");
//   SIXPOINT_CHECK(folder.save(run));              // at each step
//   SIXPOINT_CHECK(folder.append("1,2,3,4,25\n"));  // rows of samples
//   SIXPOINT_ASSIGN(const auto left, folder.load());  // in a later program
//
//     FOLDER/run.json       who, which unit, which poses are taken, and the hash of the rows so far;
//                           written anew at each step, behind the rows
//     FOLDER/samples-1.csv  rows since the first sample; -2 and so on after each restart
//     FOLDER/capture.json   a calibration file under way: which sides are done, in which recordings
//
// A power cut loses at most the samples of the last second. To be used by one thread at a time.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/env.h"
#include "station/lanes/unfinished_run.h"

namespace sixpoint::station {

class RunFolder {
 public:
  RunFolder(Env& env, std::string folder) : env_(env), folder_(std::move(folder)) {}

  // Nothing where there is no unfinished run. bad_data where the state or the rows that it was
  // saved with are damaged; the files stay.
  Result<std::optional<UnfinishedRun>> load();
  Status save(const UnfinishedRun& run);  // all but resume.raw_csv
  Status append(std::string_view rows);   // synced once a second
  Status close();                         // syncs what is open
  // Removes the run: it is in the store.
  Status clear();
  Result<std::optional<UnfinishedCapture>> load_capture();  // as load()
  Status save_capture(const UnfinishedCapture& capture);
  Status clear_capture();
  // Renames what load() cannot read, the state and its samples, or what load_capture() cannot read,
  // to names that end in `.bad`. Nothing else is touched.
  Status set_aside_run();
  // A run that has ended and that no store takes: `report` is written into the folder, and the
  // run's state and samples are set aside with it. Answers with the path of the report. After an
  // error to be called again: it replaces the report that it wrote before.
  Result<std::string> set_aside_ended_run(std::string_view report);
  Status set_aside_capture();

 private:
  Result<std::vector<std::string>> sample_files() const;  // names, oldest first
  Status set_aside(const std::vector<std::string>& names);
  // Before the first rows and the first state of a run. Samples without a state, as an interrupted
  // clear() leaves them, would else be read as this run's.
  Status remove_samples_of_no_run();

  Env& env_;
  std::string folder_;
  std::unique_ptr<WritableFile> file_;
  std::uint64_t size_ = 0;
  std::chrono::nanoseconds synced_{0};
  std::string ended_report_;  // of the run that is not set aside yet; empty where none was tried
};

// Saves a run in a folder while it is under way, so that the next program can go on with it. Where
// the disk fails, the run goes on; `warn` gets one sentence about it, once.
class RunSaver {
 public:
  RunSaver(RunFolder& folder, UnfinishedRun state, std::function<void(const std::string&)> warn)
      : folder_(folder), state_(std::move(state)), warn_(std::move(warn)) {}

  const UnfinishedRun& state() const { return state_; }
  void set_retest(const RetestState& retest) { state_.retest = retest; }
  // What an earlier program left of this unit's run, where it may be gone on with
  // (continue_rule.h); the state then names both operators. All else is removed; what cannot be
  // read is set aside, with a warning. Errors: those of the rule; the run stays.
  Result<std::optional<JigResume>> take_left_over(bool begin_again);
  void add_rows(std::string_view rows) { check(folder_.append(rows)); }  // for JigHooks::raw
  void save(const JigReport& report, const JigRun& run);                 // for JigHooks::progress
  Status save_now(const JigReport& report, const JigRun& run);  // for JigHooks::write_begins
  void end() { check(folder_.clear()); }                        // the run is stored

 private:
  void check(const Status& status);

  RunFolder& folder_;
  UnfinishedRun state_;
  std::function<void(const std::string&)> warn_;
  bool has_failed_ = false;
};

}  // namespace sixpoint::station
