// One lane, for the files of this folder alone: its thread, its unit, and what it is doing.
//
//     lane.cpp          commands of clients
//     lane_json.cpp     what clients are shown
//     lane_unit.cpp     the thread's loop; a unit is plugged in, previewed, pulled out
//     lane_run.cpp      a jig run, and how it continues after a restart of the program
//     lane_capture.cpp  a calibration file, likewise
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include <nlohmann/json.hpp>

#include "station/lanes/lanes.h"
#include "station/lanes/run_folder.h"

namespace sixpoint::station {

inline double unix_ms(UtcTime time) {
  return std::chrono::duration<double, std::milli>(time.time_since_epoch()).count();
}

inline tl::unexpected<LaneRefusal> lane_conflict(std::string what, std::string hint) {
  return tl::unexpected<LaneRefusal>(
      {LaneRefusal::Kind::conflict, std::move(what), std::move(hint)});
}

// What all lanes use.
struct Lanes::Shared {
  Env& env;
  const device::TransportRegistry& devices;
  LanesOptions options;
  StoreRun store_run;
  StoreConstants store_constants;
  std::mutex store_mutex;  // one lane at a time uses the callbacks
  std::atomic<std::uint64_t> changes{0};
};

class Lanes::Lane {
 public:
  Lane(Shared& shared, std::size_t number, std::string device);
  ~Lane();
  void request_stop();  // waits for nothing
  Lane(const Lane&) = delete;
  Lane& operator=(const Lane&) = delete;

  const std::string& device() const { return device_; }

  // A run, a capture, or "write now" (StartOrder::last_run). Beside what forbids any start, for the
  // last of these:
  //
  // | the lane's last run                          | since then               | "write now"       |
  // |----------------------------------------------|--------------------------|-------------------|
  // | passed, and began no write                   | nothing, or its unit was | written, read     |
  // |                                              | pulled out and is back,  | back and measured |
  // |                                              | or a start was refused   |                   |
  // | passed, and began no write                   | another unit was here, a | conflict          |
  // |                                              | run or a capture began,  |                   |
  // |                                              | or a restart             |                   |
  // | passed, and began no write                   | its constants were found | conflict          |
  // |                                              | withdrawn (may_write())  |                   |
  // | began a write                                | any                      | conflict          |
  // | did not pass, or there is none               | any                      | conflict          |
  LaneAnswer<void> start(const StartOrder& order, bool capture);
  LaneAnswer<void> command(const std::string& client, OperatorCommand command);
  LaneAnswer<void> confirm_side(const std::string& client);
  LaneAnswer<void> scan(const std::string& serial);
  LaneAnswer<void> release_jig(const std::string& client, const std::string& name);
  LaneAnswer<void> take_over(const std::string& client, const std::string& operator_name);

  bool holds(const std::string& serial) const {
    const std::lock_guard lock(mutex_);
    return state_ != LaneState::absent && identity_.serial == serial;
  }
  LaneState state() const {
    const std::lock_guard lock(mutex_);
    return state_;
  }
  std::uint64_t changes() const { return changes_; }
  nlohmann::ordered_json to_json() const;
  LaneTrace trace(std::uint64_t first) const;
  nlohmann::ordered_json live() const;

  // Whether the lane waits for the operator, for Lanes::queue().
  struct Wait {
    bool waits = false;
    bool is_moved = false;  // the operator has the unit in hand
    double since_ms = 0;
  };
  Wait wait() const;

 private:
  struct Order {
    StartOrder start;
    bool capture = false;
    std::string serial;  // of the unit that it is for
    std::chrono::nanoseconds given{0};
  };
  // The operator's word that the jig is free.
  struct Release {
    std::string fault;  // that the operator saw
    std::string name;   // of the operator; may be empty
    std::chrono::nanoseconds given{0};
  };
  struct LogLine {
    std::uint64_t id;
    std::string kind;
    std::string text;
    double at_ms;
  };
  // A jig run as clients are shown it: under way, or the last one.
  struct RunView {
    std::optional<Pose> wanted;
    std::string prompt;
    std::string last_refusal;
    JigProgress progress;
    std::vector<Pose> open;
    UtcTime started;
  };
  // A calibration file under way, also while its unit is away.
  struct CaptureView {
    std::optional<Pose> side;  // that the operator is asked for
    std::size_t number = 0;    // of this side, from 1
    bool placed = false;
    std::chrono::nanoseconds asked{0};  // by the clock that no one sets
    double until_ms = 0;  // Unix time at which the unit has rested long enough on this side
    std::vector<Pose> again = {};  // sides that are asked for once more
  };

  // The thread's loop (lane_unit.cpp).
  void work(const std::stop_token& stop);
  void work_once(const std::stop_token& stop);
  void end_by_defect(const std::string& what);
  void continue_unfinished(const std::stop_token& stop);
  // The order that waits, where it still holds (order_rule.h).
  std::optional<Order> next_order();
  void pause(const std::stop_token& stop, double time_s);
  bool open_unit();
  void close_unit();
  void preview(const std::stop_token& stop);
  bool start_preview(const std::stop_token& stop);
  void add_readings(const device::SampleBlock& block, const JigLive* live);
  UnitOnJig on_jig();
  // Answers with the unit of this serial number, opened anew, and `working` as the lane's state.
  // device_unavailable after the time-out or a stop by the operator; `internal` when the program
  // ends. `look` as in JigHooks::reopen; may be empty.
  Result<UnitOnJig> wait_for_unit(const std::stop_token& stop, const std::string& serial,
                                  const std::string& why, LaneState working,
                                  const JigHooks::Look& look);
  // What the jig says, and what the operator said about it.
  void look_at_jig();

  Result<UnitOnJig> wait_to_continue(const std::stop_token& stop, const StartOrder& order,
                                     const char* what, LaneState working);

  // A jig run (lane_run.cpp).
  void run(const std::stop_token& stop, const StartOrder& order,
           const std::optional<UnfinishedRun>& left);
  // "Write now": the last run goes on with its write (StartOrder::last_run).
  void write_last(const std::stop_token& stop, const StartOrder& order);
  UnfinishedRun new_run(const StartOrder& order, calib::FilterConfiguration filter);
  Result<RetestState> check_start(const std::string& serial);
  JigHooks run_hooks(const std::stop_token& stop, RunSaver& saver);
  void on_action(const JigAction& action);
  Status check_write(const UnfinishedRun& run);
  void end_without_report(const std::string& serial, const Error& error);
  void end_unmeasured(const std::string& serial, const char* verdict,
                      std::vector<std::string> reasons, std::string message);
  void continue_run(const std::stop_token& stop, const UnfinishedRun& left);
  void end_interrupted(const UnfinishedRun& left, const std::string& reason, ErrorCode code);
  // The verdict is shown at once; store_result() follows.
  void show_result(const JigReport& report, const RunLabels& labels);
  // Stores the last run. Until that succeeds, the run stays on the disk of this station. One that
  // no store takes is set aside there, and the lane is free; so is one whose storing ended by a
  // defect of the program, which may have come after the store took it.
  void store_result(const std::stop_token& stop);
  bool set_aside_result();  // false where that failed

  // A calibration file (lane_capture.cpp).
  void capture(const std::stop_token& stop, const StartOrder& order,
               const std::optional<UnfinishedCapture>& left);
  UnfinishedCapture new_capture(const StartOrder& order) const;
  CaptureHooks capture_hooks(const std::stop_token& stop, UnfinishedCapture& state);
  SideAnswer ask_side(const std::stop_token& stop, device::Pose side, std::size_t number);
  void continue_capture(const std::stop_token& stop, const UnfinishedCapture& left);
  void end_capture(nlohmann::ordered_json result);
  void end_capture_with(const Result<CaptureReport>& report, const std::string& serial);
  void end_capture_by(const Error& error, const std::string& serial);

  bool stop_requested() const {
    const std::lock_guard lock(mutex_);
    return has_stop_command();
  }
  std::optional<OperatorCommand> next_command();

  // All below: with mutex_ held.
  void changed() {
    ++changes_;
    ++shared_.changes;
  }
  bool has_stop_command() const {
    return std::find(commands_.begin(), commands_.end(), OperatorCommand::stop) != commands_.end();
  }
  bool is_busy() const {
    return state_ != LaneState::absent && state_ != LaneState::idle && state_ != LaneState::done;
  }
  // Nothing runs, or this client may command it.
  LaneAnswer<void> check_client(const std::string& client) const;
  LaneAnswer<void> check_scanned(const std::string& serial) const;
  double age_s(std::chrono::nanoseconds given) const {
    return std::chrono::duration<double>(env_.clock.elapsed() - given).count();
  }
  // An order that waits is dropped where it does not hold for what is present.
  void drop_order(const std::optional<std::string>& present);
  // The unit leaves: what waits for it is dropped.
  void drop_what_waits();
  // No constants wait to be written any more. On the lane's thread.
  void forget_unwritten() {
    unwritten_.reset();
    unwritten_serial_.clear();
  }
  void add_log(std::string kind, std::string text);
  void set_state(LaneState state, std::string message);
  void set_done(nlohmann::ordered_json result, std::string message);
  nlohmann::ordered_json run_json() const;

  Shared& shared_;
  Env& env_;
  const std::size_t number_;
  const std::string device_;
  // Used by the thread alone:
  RunFolder folder_;
  device::ManualJig manual_jig_;
  bool is_streaming_ = false;
  std::chrono::nanoseconds last_sample_{0};
  std::chrono::nanoseconds last_accepted_{0};
  // The last run until it is stored.
  struct Unstored {
    JigReport report;
    RunLabels labels;
    // Why it is set aside and the store is not asked again, for people; empty: it is asked.
    std::string never_again = {};
  };
  std::optional<Unstored> unstored_;
  // The last run, where it passed and nothing was written, for write_last(). Without the id of its
  // constants as long as there is no record of them.
  std::optional<UnfinishedRun> unwritten_;

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable_any wake_;
  std::unique_ptr<device::Unit> unit_;  // made and ended by the thread; others may cancel()
  device::Unit* opening_ = nullptr;     // the same, before it is unit_
  bool is_unstored_ = false;            // the store did not take the last run yet
  std::string unwritten_serial_;        // of unwritten_; empty: none
  device::Identity identity_;
  calib::Calibration approximation_;
  bool turns_by_itself_ = false;
  std::string jig_fault_;           // why the jig holds still; empty where it is free
  std::optional<Release> release_;  // the operator says that it is free
  LaneState state_ = LaneState::absent;
  std::string message_;
  std::string scanned_;
  std::string operator_name_;
  std::string client_;
  bool write_ = false;
  std::optional<Order> order_;
  std::deque<OperatorCommand> commands_;
  std::deque<LogLine> log_;
  std::uint64_t log_lines_ = 0;
  double waiting_since_ms_ = 0;
  std::optional<RunView> run_;
  std::optional<CaptureView> capture_;
  nlohmann::ordered_json result_;  // null until a run has ended
  std::deque<PerAxis<std::int16_t>> readings_;
  std::uint64_t readings_taken_ = 0;
  double newest_ms_ = 0;
  JigLive live_;
  std::atomic<std::uint64_t> changes_{0};

  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace sixpoint::station
