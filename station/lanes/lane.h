// One lane of the station, for lanes.cpp alone: its thread, its unit, and what it is doing.
//
//   lane.cpp          commands, what the page shows, the thread's loop, the unit that comes and
//   goes lane_run.cpp      a jig run, and its going on after a restart of the program
//   lane_capture.cpp  a calibration file, likewise
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include <nlohmann/json.hpp>

#include "station/lanes.h"
#include "station/run_folder.h"

namespace sixpoint::station {

inline std::chrono::nanoseconds from_seconds(double time_s) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(time_s));
}

inline double unix_ms(UtcTime time) {
  return std::chrono::duration<double, std::milli>(time.time_since_epoch()).count();
}

inline tl::unexpected<LaneRefusal> lane_conflict(std::string what, std::string hint) {
  return tl::unexpected<LaneRefusal>(
      {LaneRefusal::Kind::conflict, std::move(what), std::move(hint)});
}

// What all lanes use.
struct Lanes::Shared {
  Shared(Env& its_env, const device::TransportRegistry& its_devices, LanesOptions its_options,
         RunKeeper run_keeper, CaptureKeeper capture_keeper)
      : env(its_env),
        devices(its_devices),
        options(std::move(its_options)),
        keep_run(std::move(run_keeper)),
        keep_capture(std::move(capture_keeper)) {}

  Env& env;
  const device::TransportRegistry& devices;
  LanesOptions options;
  RunKeeper keep_run;
  CaptureKeeper keep_capture;
  std::mutex store;  // one lane at a time
  std::atomic<std::uint64_t> changes{0};
};

class Lanes::Lane {
 public:
  Lane(Shared& shared, std::size_t number, std::string device);
  ~Lane();
  Lane(const Lane&) = delete;
  Lane& operator=(const Lane&) = delete;

  const std::string& device() const { return device_; }

  LaneAnswer<void> start(const StartOrder& order, bool capture);

  LaneAnswer<void> say(const std::string& client, OperatorWord word);

  LaneAnswer<void> side_is_placed(const std::string& client);

  LaneAnswer<void> scan(const std::string& serial);

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

  // For the queue of hands: when it began to wait, and whether somebody is at it.
  struct Wait {
    bool waits = false;
    bool in_hand = false;
    double since_ms = 0;
  };
  Wait wait() const;

 private:
  struct Order {
    StartOrder start;
    bool capture = false;
  };
  struct Line {
    std::uint64_t id;
    std::string kind;
    std::string text;
    double at_ms;
  };

  void work(const std::stop_token& stop);
  void pause(const std::stop_token& stop, double time_s);
  bool open_unit();
  void close_unit();
  void preview(const std::stop_token& stop);
  void see(const device::SampleBlock& block, const JigLive* live);
  void run(const std::stop_token& stop, const Order& order,
           const std::optional<UnfinishedRun>& left);
  void resume(const std::stop_token& stop);
  void close_interrupted(const UnfinishedRun& left, const std::string& reason);
  void conclude(const JigReport& report, const RunLabels& labels);
  void keep(const std::stop_token& stop);
  void capture(const std::stop_token& stop, const Order& order,
               const std::optional<UnfinishedCapture>& left);
  void resume_capture(const std::stop_token& stop, const UnfinishedCapture& left);
  void end_capture(nlohmann::ordered_json result);
  SideAnswer ask_side(const std::stop_token& stop, device::Pose side, std::size_t number);
  // Answers with the unit of this serial number, opened anew, and `working` as the lane's state.
  Result<UnitOnJig> wait_for_unit(const std::stop_token& stop, const std::string& serial,
                                  const std::string& why, LaneState working);
  UnitOnJig on_jig();

  // With mutex_ held.
  void changed() {
    ++changes_;
    ++shared_.changes;
  }
  bool is_busy() const {
    return state_ == LaneState::running || state_ == LaneState::unit_away ||
           state_ == LaneState::wrong_unit || state_ == LaneState::capturing ||
           state_ == LaneState::resuming;
  }
  LaneAnswer<void> obeys(const std::string& client) const;
  void tell(std::string kind, std::string text);
  void set_state(LaneState state, std::string message);
  std::optional<OperatorWord> take_word();
  bool stop_was_said() const {
    const std::lock_guard lock(mutex_);
    return std::find(words_.begin(), words_.end(), OperatorWord::stop) != words_.end();
  }

  Shared& shared_;
  Env& env_;
  const std::size_t number_;
  const std::string device_;
  RunFolder folder_;  // the thread's own
  device::ManualJig by_hand_;
  bool streaming_ = false;
  std::chrono::nanoseconds heard_{0};
  // A report whose storing failed, to be tried again.
  struct Unkept {
    JigReport report;
    RunLabels labels;
  };
  std::optional<Unkept> unkept_;

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable_any wake_;
  std::unique_ptr<device::Unit> unit_;  // made and ended by the thread; others may cancel()
  device::Identity identity_;
  calib::Calibration approximation_;
  bool turns_by_itself_ = false;
  LaneState state_ = LaneState::absent;
  std::string message_;
  std::string scanned_;
  std::string operator_name_;
  std::string client_;
  bool write_ = false;
  std::optional<Order> order_;
  std::deque<OperatorWord> words_;
  std::deque<Line> log_;
  std::uint64_t lines_ = 0;
  double waiting_since_ms_ = 0;
  std::optional<Pose> wanted_;
  std::string prompt_;
  std::string last_refusal_;
  JigProgress progress_;
  std::vector<Pose> open_;
  bool has_run_ = false;
  nlohmann::ordered_json result_;  // null until a run has ended
  bool has_capture_ = false;       // one is under way, whether or not the unit is there
  std::optional<Pose> asked_side_;
  std::size_t side_number_ = 0;
  bool side_placed_ = false;
  double side_until_ms_ = 0;
  std::deque<PerAxis<std::int16_t>> readings_;
  std::uint64_t taken_ = 0;
  double newest_ms_ = 0;
  JigLive live_;
  std::atomic<std::uint64_t> changes_{0};

  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace sixpoint::station
