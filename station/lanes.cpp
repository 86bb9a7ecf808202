#include "station/lanes.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "gt3x/model.h"
#include "station/run_folder.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;
using std::chrono::milliseconds;

constexpr std::size_t kTraceSeconds = 6;
constexpr std::size_t kLogLines = 30;
// A unit without a readable page is shown by the middle of what units hold.

std::chrono::nanoseconds from_seconds(double time_s) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(time_s));
}

double unix_ms(UtcTime time) {
  return std::chrono::duration<double, std::milli>(time.time_since_epoch()).count();
}

std::string_view to_string(JigAction::Kind kind) {
  switch (kind) {
    case JigAction::Kind::place:
      return "place";
    case JigAction::Kind::accepted:
      return "accepted";
    case JigAction::Kind::refused:
      return "refused";
    case JigAction::Kind::dropped:
      return "dropped";
    case JigAction::Kind::fit:
      return "fit";
    case JigAction::Kind::write:
      return "write";
    case JigAction::Kind::finished:
      return "finished";
  }
  return "?";
}

// The folder of a lane: the same device in the same lane finds what it left.
std::string folder_of_lane(const std::string& state_folder, std::size_t number,
                           const std::string& device) {
  const auto digest =
      sha256(std::span(reinterpret_cast<const std::uint8_t*>(device.data()), device.size()));
  return fmt::format("{}/lane-{}-{}", state_folder, number, to_hex(std::span(digest).first(4)));
}

tl::unexpected<LaneRefusal> conflict(std::string what, std::string hint) {
  return tl::unexpected<LaneRefusal>(
      {LaneRefusal::Kind::conflict, std::move(what), std::move(hint)});
}

}  // namespace

std::string_view to_string(LaneState state) {
  switch (state) {
    case LaneState::absent:
      return "absent";
    case LaneState::idle:
      return "idle";
    case LaneState::resuming:
      return "resuming";
    case LaneState::running:
      return "running";
    case LaneState::unit_away:
      return "unit_away";
    case LaneState::wrong_unit:
      return "wrong_unit";
    case LaneState::capturing:
      return "capturing";
    case LaneState::done:
      return "done";
  }
  return "?";
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
  Lane(Shared& shared, std::size_t number, std::string device)
      : shared_(shared),
        env_(shared.env),
        number_(number),
        device_(std::move(device)),
        folder_(env_, folder_of_lane(shared.options.state_folder, number, device_)) {
    thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
  }
  ~Lane() {
    thread_.request_stop();
    {
      const std::lock_guard lock(mutex_);
      if (unit_) {
        unit_->cancel();
      }
    }
    wake_.notify_all();
    thread_.join();
  }
  Lane(const Lane&) = delete;
  Lane& operator=(const Lane&) = delete;

  const std::string& device() const { return device_; }

  LaneAnswer<void> start(const StartOrder& order, bool capture) {
    const std::lock_guard lock(mutex_);
    if (order_ || (state_ != LaneState::idle && state_ != LaneState::done)) {
      if (state_ == LaneState::absent) {
        return conflict("no unit is plugged in here", "plug one in");
      }
      return conflict(fmt::format("this lane is at work for {}", printable(operator_name_, 60)),
                      "wait for its end, or take the lane over");
    }
    const std::string scanned = order.serial.empty() ? scanned_ : order.serial;
    if (!scanned.empty() && scanned != identity_.serial) {
      scanned_ = scanned;
      changed();
      return conflict(fmt::format("{} was scanned, but the unit says that it is {}",
                                  printable(scanned, 40), printable(identity_.serial, 40)),
                      "put the right unit in, or scan the label of this one");
    }
    order_ = Order{order, capture};
    operator_name_ = order.operator_name;
    client_ = order.client;
    changed();
    wake_.notify_all();
    return {};
  }

  LaneAnswer<void> say(const std::string& client, OperatorWord word) {
    const std::lock_guard lock(mutex_);
    if (auto mine = obeys(client); !mine) {
      return mine;
    }
    if (!is_busy()) {
      return conflict("nothing runs in this lane", "start a run first");
    }
    if (words_.size() < 8) {
      words_.push_back(word);
    }
    wake_.notify_all();
    return {};
  }

  LaneAnswer<void> side_is_placed(const std::string& client) {
    const std::lock_guard lock(mutex_);
    if (auto mine = obeys(client); !mine) {
      return mine;
    }
    if (state_ != LaneState::capturing || !asked_side_) {
      return conflict("no side is asked for in this lane", "start a capture first");
    }
    side_placed_ = true;
    wake_.notify_all();
    return {};
  }

  LaneAnswer<void> scan(const std::string& serial) {
    const std::lock_guard lock(mutex_);
    if (is_busy() || order_) {
      return conflict("a run is under way in this lane", "scan before the run");
    }
    scanned_ = serial;
    changed();
    if (state_ != LaneState::absent && serial != identity_.serial) {
      return conflict(fmt::format("{} was scanned, but the unit says that it is {}",
                                  printable(serial, 40), printable(identity_.serial, 40)),
                      "put the right unit in, or scan the label of this one");
    }
    return {};
  }

  LaneAnswer<void> take_over(const std::string& client, const std::string& operator_name) {
    const std::lock_guard lock(mutex_);
    if (!is_busy()) {
      return conflict("nothing runs in this lane", "start a run first");
    }
    client_ = client;
    if (!operator_name.empty()) {
      operator_name_ = operator_name;
    }
    changed();
    return {};
  }

  bool holds(const std::string& serial) const {
    const std::lock_guard lock(mutex_);
    return state_ != LaneState::absent && identity_.serial == serial;
  }
  LaneState state() const {
    const std::lock_guard lock(mutex_);
    return state_;
  }
  std::uint64_t changes() const { return changes_; }

  Json to_json() const;

  LaneTrace trace(std::uint64_t first) const {
    const std::lock_guard lock(mutex_);
    LaneTrace trace;
    const std::uint64_t oldest = taken_ - readings_.size();
    trace.first = std::clamp(first, oldest, taken_);
    trace.force_mg.assign(readings_.begin() + static_cast<std::ptrdiff_t>(trace.first - oldest),
                          readings_.end());
    trace.host_ms = newest_ms_;
    return trace;
  }
  Json live() const {
    const std::lock_guard lock(mutex_);
    Json json;
    json["stillness"] = station::to_string(live_.stillness);
    json["dwell"] = std::round(live_.dwell_fraction * 100) / 100;
    json["face"] = live_.face ? Json(device::to_string(live_.face->pose)) : Json(nullptr);
    json["angle_deg"] =
        live_.face ? Json(std::round(live_.face->angle_deg * 10) / 10) : Json(nullptr);
    return json;
  }

  // For the queue of hands: when it began to wait, and whether somebody is at it.
  struct Wait {
    bool waits = false;
    bool in_hand = false;
    double since_ms = 0;
  };
  Wait wait() const {
    const std::lock_guard lock(mutex_);
    Wait wait;
    wait.since_ms = waiting_since_ms_;
    if (state_ == LaneState::capturing) {
      wait.waits = asked_side_.has_value() && !side_placed_;
    } else if (state_ == LaneState::running && !turns_by_itself_ && wanted_) {
      wait.waits =
          live_.stillness == JigStillness::moving || live_.stillness == JigStillness::leaving;
      wait.in_hand = live_.stillness == JigStillness::moving;
    } else {
      wait.waits = state_ == LaneState::unit_away || state_ == LaneState::wrong_unit;
    }
    return wait;
  }

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
  void capture(const std::stop_token& stop, const Order& order);
  Result<UnitOnJig> wait_for_unit(const std::stop_token& stop, const std::string& serial,
                                  const std::string& why);
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
  LaneAnswer<void> obeys(const std::string& client) const {
    if (is_busy() && client != client_) {
      return conflict(fmt::format("this lane is at work for {}", printable(operator_name_, 60)),
                      "take the lane over first");
    }
    return {};
  }
  void tell(std::string kind, std::string text) {
    log_.push_back({++lines_, std::move(kind), std::move(text), unix_ms(env_.clock.now())});
    if (log_.size() > kLogLines) {
      log_.pop_front();
    }
    changed();
  }
  void set_state(LaneState state, std::string message) {
    if (state != state_ || message != message_) {
      state_ = state;
      message_ = std::move(message);
      changed();
    }
  }
  std::optional<OperatorWord> take_word() {
    const std::lock_guard lock(mutex_);
    if (words_.empty()) {
      return std::nullopt;
    }
    const OperatorWord word = words_.front();
    words_.pop_front();
    return word;
  }
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
  Json result_;  // null until a run has ended
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

Json Lanes::Lane::to_json() const {
  const std::lock_guard lock(mutex_);
  Json json;
  json["lane"] = number_;
  json["device"] = printable(device_);
  json["state"] = station::to_string(state_);
  json["message"] = message_;
  json["turns_by_itself"] = turns_by_itself_;
  if (state_ == LaneState::absent || identity_.serial.empty()) {
    json["unit"] = nullptr;
  } else {
    json["unit"]["serial"] = identity_.serial;
    json["unit"]["firmware"] = identity_.firmware;
    json["unit"]["model"] = gt3x::model_of(identity_.serial);
    json["unit"]["battery_mv"] = identity_.battery_mv;
  }
  if (scanned_.empty()) {
    json["scan"] = nullptr;
  } else {
    json["scan"]["serial"] = printable(scanned_, 40);
    json["scan"]["matches"] = state_ != LaneState::absent && scanned_ == identity_.serial;
  }
  json["operator"] = printable(operator_name_, 100);
  json["client"] = client_;
  json["write"] = write_;
  json["run"] = nullptr;
  if (has_run_) {
    Json& run = json["run"];
    run["phase"] = station::to_string(progress_.phase);
    run["wanted"] = wanted_ ? Json(device::to_string(*wanted_)) : Json(nullptr);
    run["prompt"] = prompt_;
    run["open"] = Json::array();
    for (const Pose pose : open_) {
      run["open"].push_back(device::to_string(pose));
    }
    run["taken"] = Json::array();
    const auto list = [&run](const char* round, const std::vector<PoseReading>& readings) {
      for (const PoseReading& reading : readings) {
        run["taken"].push_back({{"round", round},
                                {"pose", device::to_string(reading.pose)},
                                {"tilt_deg", std::round(reading.tilt_deg * 10) / 10}});
      }
    };
    list("faces", progress_.faces);
    list("faces_reversed", progress_.reversed);
    list("reseat", progress_.reseat);
    list("recheck", progress_.recheck);
    const JigRunOptions& options = shared_.options.session.run;
    run["of"] = device::kPoses.size() + options.verification.size() + options.reseat.size() +
                (write_ ? options.recheck.size() : 0);
    run["refusals"] = progress_.refusals;
    run["last_refusal"] = last_refusal_;
    run["waiting_since_ms"] = waiting_since_ms_;
  }
  json["capture"] = nullptr;
  if (state_ == LaneState::capturing) {
    json["capture"]["side"] = asked_side_ ? Json(device::to_string(*asked_side_)) : Json(nullptr);
    json["capture"]["number"] = side_number_;
    json["capture"]["of"] = device::kPoses.size();
    json["capture"]["placed"] = side_placed_;
    json["capture"]["until_ms"] = side_until_ms_;
    json["capture"]["side_s"] = shared_.options.capture.side_s;
  }
  json["result"] = result_;
  json["log"] = Json::array();
  for (const Line& line : log_) {
    json["log"].push_back(
        {{"id", line.id}, {"kind", line.kind}, {"text", line.text}, {"at_ms", line.at_ms}});
  }
  return json;
}

void Lanes::Lane::pause(const std::stop_token& stop, double time_s) {
  std::unique_lock lock(mutex_);
  const std::size_t words = words_.size();
  wake_.wait_for(lock, stop, from_seconds(time_s),
                 [&] { return words_.size() != words || order_.has_value(); });
}

UnitOnJig Lanes::Lane::on_jig() {
  device::Jig* jig = unit_->jig() != nullptr ? unit_->jig() : &by_hand_;
  return {unit_.get(), jig};
}

// True when a unit is there and says who it is.
bool Lanes::Lane::open_unit() {
  Result<device::Link> link = shared_.devices.open(device_, env_);
  std::unique_ptr<device::Unit> unit;
  Error problem;
  if (!link) {
    problem = link.error();
  } else if (auto opened = device::Unit::open(*std::move(link)); opened) {
    unit = *std::move(opened);
  } else {
    problem = opened.error();
  }
  std::optional<StoredConstants> stored;
  if (unit) {
    if (const auto page = unit->read_calibration()) {
      stored = page->constants;
    }
  }
  const calib::Calibration approximation = first_approximation(stored).calibration;
  streaming_ = false;
  const std::lock_guard lock(mutex_);
  if (!unit) {
    if (!is_busy()) {
      set_state(LaneState::absent, problem.brief());
    }
    return false;
  }
  if (unit->identity().serial != identity_.serial) {
    // Another unit: nothing of the one before stays on the lane.
    if (!is_busy()) {
      result_ = nullptr;
      has_run_ = false;
      log_.clear();
    }
    readings_.clear();
  }
  heard_ = unit->clock().elapsed();
  turns_by_itself_ = unit->jig() != nullptr && unit->jig()->turns_by_itself();
  identity_ = unit->identity();
  approximation_ = approximation;
  live_ = {};
  unit_ = std::move(unit);
  changed();
  return true;
}

void Lanes::Lane::close_unit() {
  const std::lock_guard lock(mutex_);
  unit_.reset();
  live_ = {};
}

void Lanes::Lane::see(const device::SampleBlock& block, const JigLive* live) {
  const std::lock_guard lock(mutex_);
  const int rate_hz = shared_.options.session.run.rate_hz;
  const auto most = kTraceSeconds * static_cast<std::size_t>(rate_hz);
  PerAxis<double> sum_mg{};
  for (const device::RawCounts& counts : block.counts) {
    PerAxis<std::int16_t> force_mg{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double mg = (counts[axis] - approximation_.zero_lsb[axis]) *
                        approximation_.sensitivity_g_per_lsb[axis] * kMgPerG;
      force_mg[axis] = static_cast<std::int16_t>(std::clamp(std::round(mg), -32000.0, 32000.0));
      sum_mg[axis] += mg;
    }
    readings_.push_back(force_mg);
    ++taken_;
    if (readings_.size() > most) {
      readings_.pop_front();
    }
  }
  newest_ms_ = unix_ms(env_.clock.now());
  if (live != nullptr) {
    live_ = *live;
  } else {
    live_.face = nearest_face(sum_mg);
  }
}

// Shows what the unit reads while nothing runs, and notices when it goes.
void Lanes::Lane::preview(const std::stop_token& stop) {
  if (!streaming_) {
    if (const Status started = unit_->start_stream(shared_.options.session.run.rate_hz); !started) {
      if (started.error().code == ErrorCode::device_unavailable) {
        close_unit();
        return;
      }
      // It records, or does not stream by itself: it is asked who it is instead.
      if (!unit_->identify()) {
        close_unit();
        return;
      }
      pause(stop, shared_.options.silence_s);
      return;
    }
    streaming_ = true;
    heard_ = unit_->clock().elapsed();
  }
  const auto machine_before = env_.clock.elapsed();
  const auto unit_before = unit_->clock().elapsed();
  const auto block = unit_->next_samples(milliseconds(100));
  const auto unit_now = unit_->clock().elapsed();
  if (!block || (!*block && unit_now - heard_ > from_seconds(shared_.options.silence_s))) {
    close_unit();
    return;
  }
  if (*block) {
    heard_ = unit_now;
    see(**block, nullptr);
  }
  // A unit in software whose time passes by waiting would keep a core busy.
  if (unit_now - unit_before > 10 * (env_.clock.elapsed() - machine_before)) {
    pause(stop, 0.06);
  }
}

void Lanes::Lane::work(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    auto left = folder_.load();
    if (!left) {
      const std::lock_guard lock(mutex_);
      tell("problem", left.error().brief());
      static_cast<void>(folder_.set_aside());
    } else if (*left) {
      resume(stop);
    }
    break;
  }
  while (!stop.stop_requested()) {
    keep(stop);
    if (!unit_ && !open_unit()) {
      pause(stop, shared_.options.retry_s);
      continue;
    }
    std::optional<Order> order;
    {
      const std::lock_guard lock(mutex_);
      if (state_ == LaneState::absent) {
        set_state(LaneState::idle, "");
      }
      order = std::exchange(order_, std::nullopt);
      words_.clear();
      if (order) {
        write_ = order->start.write;
        last_refusal_.clear();
        result_ = nullptr;
        has_run_ = false;
        log_.clear();
        set_state(order->capture ? LaneState::capturing : LaneState::running, "");
      }
    }
    if (order) {
      if (streaming_) {
        static_cast<void>(unit_->stop_stream());
        streaming_ = false;
      }
      if (order->capture) {
        capture(stop, *order);
      } else {
        run(stop, *order, {});
      }
    } else {
      preview(stop);
    }
  }
  static_cast<void>(folder_.close());
}

// Answers with the unit of this serial number, opened anew. Gives up with device_unavailable when
// time or the operator says so, with `internal` when the program ends.
Result<UnitOnJig> Lanes::Lane::wait_for_unit(const std::stop_token& stop, const std::string& serial,
                                             const std::string& why) {
  close_unit();
  const auto deadline = env_.clock.elapsed() + from_seconds(shared_.options.unit_wait_s);
  {
    const std::lock_guard lock(mutex_);
    waiting_since_ms_ = unix_ms(env_.clock.now());
    set_state(LaneState::unit_away, fmt::format("plug unit {} in again", printable(serial, 40)));
    tell("away", why);
  }
  while (!stop.stop_requested()) {
    if (stop_was_said()) {
      return fail(ErrorCode::device_unavailable, "stopped by the operator");
    }
    if (env_.clock.elapsed() > deadline) {
      return fail(
          ErrorCode::device_unavailable,
          fmt::format("the unit did not come back within {:.0f} s", shared_.options.unit_wait_s));
    }
    if (open_unit()) {
      if (unit_->identity().serial == serial) {
        const std::lock_guard lock(mutex_);
        set_state(LaneState::running, "");
        tell("back", "the unit is back; the run goes on");
        return on_jig();
      }
      const std::string other = unit_->identity().serial;
      close_unit();
      const std::lock_guard lock(mutex_);
      set_state(LaneState::wrong_unit,
                fmt::format("this is {}, and the run is of {}: put {} back, or stop the run",
                            printable(other, 40), printable(serial, 40), printable(serial, 40)));
    } else {
      const std::lock_guard lock(mutex_);
      set_state(LaneState::unit_away, fmt::format("plug unit {} in again", printable(serial, 40)));
    }
    pause(stop, shared_.options.retry_s);
  }
  return fail(ErrorCode::internal, "the program ends");
}

void Lanes::Lane::run(const std::stop_token& stop, const Order& order,
                      const std::optional<UnfinishedRun>& left) {
  JigSessionOptions session = shared_.options.session;
  session.run.write = order.start.write;
  session.run.pose_time_out_s = shared_.options.pose_time_out_s;
  session.silence_s = shared_.options.silence_s;
  UnfinishedRun state;
  if (left) {
    state = *left;
    session.filter = left->filter;
  } else {
    state.device = device_;
    state.serial = identity_.serial;
    state.firmware = identity_.firmware;
    state.operator_name = order.start.operator_name;
    state.station = shared_.options.station;
    state.client = order.start.client;
    state.write = order.start.write;
    state.filter = session.filter;
  }
  if (shared_.options.may_start) {
    const std::lock_guard lock(shared_.store);
    if (auto retest = shared_.options.may_start(state.serial); retest) {
      session.retest = *std::move(retest);
    } else if (!left) {
      // The station is locked, or the unit failed too often: an engineer decides.
      const std::lock_guard own(mutex_);
      result_ = Json{{"kind", "jig"},
                     {"serial", state.serial},
                     {"verdict", "refused"},
                     {"reasons", Json::array({retest.error().what, retest.error().hint})},
                     {"stored", false}};
      set_state(LaneState::done, retest.error().brief());
      changed();
      return;
    }
  }
  const RunLabels labels{state.operator_name, state.station, session.retest.retest_of};
  auto last_accepted = env_.clock.elapsed();

  JigHooks hooks;
  hooks.tell = [&](const JigAction& action) {
    const std::lock_guard lock(mutex_);
    switch (action.kind) {
      case JigAction::Kind::place:
        wanted_ = action.pose;
        prompt_ = action.text;
        waiting_since_ms_ = unix_ms(env_.clock.now());
        break;
      case JigAction::Kind::refused:
        last_refusal_ = action.text;
        break;
      case JigAction::Kind::accepted:
        last_refusal_.clear();
        last_accepted = env_.clock.elapsed();
        break;
      case JigAction::Kind::write:
      case JigAction::Kind::finished:
        wanted_.reset();
        prompt_ = action.text;
        break;
      case JigAction::Kind::dropped:
      case JigAction::Kind::fit:
        break;
    }
    tell(std::string(to_string(action.kind)), action.text);
  };
  hooks.samples = [&](const device::SampleBlock& block, const JigRun& machine) {
    const JigLive live = machine.live();
    see(block, &live);
  };
  bool disk_failed = false;
  const auto on_disk = [&](const Status& status) {
    if (!status && !std::exchange(disk_failed, true)) {
      const std::lock_guard lock(mutex_);
      tell("problem", "this run would not survive a restart: " + status.error().brief());
    }
  };
  hooks.raw = [&](std::string_view rows) { on_disk(folder_.append(rows)); };
  hooks.progress = [&](const JigReport& report, const JigRun& machine) {
    state.resume.started = report.started;
    state.resume.as_found = report.as_found;
    state.resume.written = report.written ? report.as_left : std::nullopt;
    state.resume.progress = machine.progress();
    if (machine.phase() != JigPhase::finished) {
      on_disk(folder_.save(state));
    }
    const std::lock_guard lock(mutex_);
    progress_ = machine.progress();
    open_ = machine.open_poses();
    has_run_ = true;
    changed();
  };
  hooks.words = [&] { return take_word(); };
  hooks.reopen = [&](const Error& error) { return wait_for_unit(stop, state.serial, error.what); };

  const auto report =
      run_jig(on_jig(), env_, session, hooks, left ? std::optional(left->resume) : std::nullopt);
  if (stop.stop_requested()) {
    static_cast<void>(folder_.close());  // goes on at the next start of the program
    return;
  }
  if (!report) {
    state.resume.raw_csv.clear();
    static_cast<void>(folder_.close());
    if (auto kept = folder_.load(); kept && *kept) {
      close_interrupted(**kept, report.error().brief());
    } else {
      const std::lock_guard lock(mutex_);
      wanted_.reset();
      has_run_ = false;
      result_ = Json{{"kind", "jig"},
                     {"serial", state.serial},
                     {"verdict", "inconclusive"},
                     {"reasons", Json::array({report.error().brief()})},
                     {"stored", false}};
      set_state(LaneState::done, report.error().brief());
      changed();
    }
    if (report.error().code == ErrorCode::device_unavailable) {
      close_unit();
    }
    return;
  }
  conclude(*report, labels);
  const std::lock_guard lock(mutex_);
  result_["verdict_ms"] =
      std::chrono::duration<double, std::milli>(env_.clock.elapsed() - last_accepted).count();
  if (report->six && report->usable()) {
    approximation_ = report->six->best().calibration;  // from here on it reads what it should
  }
  changed();
}

// The verdict is shown at once; storing it follows (keep()).
void Lanes::Lane::conclude(const JigReport& report, const RunLabels& labels) {
  Json result;
  result["kind"] = "jig";
  result["serial"] = report.serial;
  result["verdict"] = station::to_string(report.verdict);
  result["reasons"] = report.reasons;
  result["residual_mg"] =
      report.verification.poses.empty() ? Json(nullptr) : Json(report.verification.worst_mg);
  result["as_found_residual_mg"] =
      report.as_found ? Json(report.as_found_residual_mg) : Json(nullptr);
  result["written"] = report.written;
  result["refusals"] = report.refusals;
  result["stored"] = false;
  unkept_ = Unkept{report, labels};
  const std::lock_guard lock(mutex_);
  wanted_.reset();
  open_.clear();
  progress_.phase = JigPhase::finished;
  result_ = std::move(result);
  live_ = {};
  set_state(LaneState::done, "");
  changed();
}

// Puts the last run into the store; until that succeeds it stays on the disk of this station.
void Lanes::Lane::keep(const std::stop_token& stop) {
  if (!unkept_) {
    return;
  }
  Result<KeptRun> kept;
  {
    const std::lock_guard lock(shared_.store);
    kept = shared_.keep_run(unkept_->report, unkept_->labels);
  }
  if (!kept) {
    {
      const std::lock_guard lock(mutex_);
      const std::string problem = "not stored yet: " + kept.error().brief();
      if (result_.is_object() && result_["serial"] == unkept_->report.serial) {
        result_["problem"] = problem;
      }
      tell("problem", problem);
    }
    pause(stop, 2);
    return;
  }
  const Status cleared = folder_.clear();
  const std::lock_guard lock(mutex_);
  if (!cleared) {
    tell("problem", cleared.error().brief());
  }
  if (result_.is_object() && result_["serial"] == unkept_->report.serial) {
    result_["stored"] = true;
    result_["run"] = kept->run_id;
    result_["constants_id"] = kept->constants_id ? Json(*kept->constants_id) : Json(nullptr);
    result_.erase("problem");
  }
  unkept_.reset();
  changed();
}

// A run that an earlier program left: waits for its unit and goes on, or is closed with its data.
void Lanes::Lane::resume(const std::stop_token& stop) {
  auto loaded = folder_.load();
  if (!loaded || !*loaded) {
    return;
  }
  const UnfinishedRun left = **std::move(loaded);
  {
    const std::lock_guard lock(mutex_);
    operator_name_ = left.operator_name;
    client_ = left.client;
    write_ = left.write;
    progress_ = left.resume.progress;
    has_run_ = true;
    identity_.serial = left.serial;
    identity_.firmware = left.firmware;
    set_state(LaneState::resuming,
              fmt::format("waits for unit {} to go on with its run", printable(left.serial, 40)));
  }
  const auto unit =
      wait_for_unit(stop, left.serial, "the program was started again; the run goes on");
  if (stop.stop_requested()) {
    return;
  }
  if (!unit) {
    close_interrupted(left, "interrupted: " + unit.error().what);
    return;
  }
  Order order;
  order.start = {left.operator_name, left.client, left.serial, left.write};
  run(stop, order, left);
}

void Lanes::Lane::close_interrupted(const UnfinishedRun& left, const std::string& reason) {
  JigSessionOptions session = shared_.options.session;
  session.filter = left.filter;
  conclude(interrupted_report(left.resume, left.serial, left.firmware, session, env_.clock.now(),
                              reason),
           {left.operator_name, left.station, {}});
}

void Lanes::Lane::capture(const std::stop_token& stop, const Order& order) {
  CaptureOptions options = shared_.options.capture;
  const std::string day = to_iso8601(env_.clock.now()).substr(0, 19);
  std::string name = fmt::format("{}-calibration-{}.gt3x", printable(identity_.serial, 20), day);
  std::replace(name.begin(), name.end(), ':', '-');
  options.output = shared_.options.capture_folder + "/" + name;
  options.cancelled = [&] { return stop.stop_requested() || stop_was_said(); };
  const UnitOnJig placed = on_jig();
  const SidePrompt prompt = [&](device::Pose side, std::size_t number, std::size_t /*of*/) {
    std::unique_lock lock(mutex_);
    asked_side_ = side;
    side_number_ = number;
    side_placed_ = placed.jig->turns_by_itself();
    waiting_since_ms_ = unix_ms(env_.clock.now());
    changed();
    const auto ready = [&] {
      return side_placed_ ||
             std::find(words_.begin(), words_.end(), OperatorWord::stop) != words_.end();
    };
    // A unit left on the bench over lunch must not record until it is empty.
    if (!wake_.wait_for(lock, stop, from_seconds(shared_.options.unit_wait_s), ready) ||
        !side_placed_) {
      return false;
    }
    side_until_ms_ = unix_ms(env_.clock.now()) + 1000 * (options.turn_s + options.side_s);
    changed();
    return true;
  };
  const auto report = run_capture(*placed.unit, *placed.jig, env_, options, prompt);
  Json result;
  result["kind"] = "capture";
  result["serial"] = identity_.serial;
  result["stored"] = false;
  std::optional<std::string> constants_id;
  if (!report) {
    result["verdict"] = "inconclusive";
    result["reasons"] = {report.error().brief()};
  } else {
    result["verdict"] = report->stopped            ? "stopped"
                        : !report->refusal.empty() ? "refused"
                        : report->usable()         ? "pass"
                                                   : "fail";
    result["reasons"] = report->solved ? report->solved->verification.reasons : report->refusal;
    result["file"] = report->file;
    result["repeat_sides"] =
        report->solved ? Json(report->solved->verification.missing_directions) : Json::array();
    if (report->usable()) {
      const std::lock_guard lock(shared_.store);
      if (const auto id = shared_.keep_capture(*report)) {
        result["stored"] = true;
        result["constants_id"] = *id;
      } else {
        result["problem"] = id.error().brief();
      }
    }
  }
  {
    const std::lock_guard lock(mutex_);
    asked_side_.reset();
    side_until_ms_ = 0;
    result_ = std::move(result);
    set_state(LaneState::done, "");
    changed();
  }
  if (!report && report.error().code == ErrorCode::device_unavailable) {
    close_unit();
  }
  static_cast<void>(order);
}

// --- Lanes ---

Lanes::Lanes() = default;
Lanes::~Lanes() = default;

Result<std::unique_ptr<Lanes>> Lanes::open(Env& env, const device::TransportRegistry& devices,
                                           LanesOptions options, RunKeeper keep_run,
                                           CaptureKeeper keep_capture) {
  if (options.devices.empty() || options.devices.size() > kMostLanes) {
    return fail(
        ErrorCode::usage,
        fmt::format("a station has 1 to {} lanes, not {}", kMostLanes, options.devices.size()), {},
        "name each unit's device with --device");
  }
  SIXPOINT_CHECK(env.files.make_folders(options.state_folder));
  std::unique_ptr<Lanes> lanes(new Lanes);
  lanes->shared_ = std::make_unique<Shared>(env, devices, std::move(options), std::move(keep_run),
                                            std::move(keep_capture));
  for (const std::string& device : lanes->shared_->options.devices) {
    lanes->lanes_.push_back(
        std::make_unique<Lane>(*lanes->shared_, lanes->lanes_.size() + 1, device));
  }
  return lanes;
}

std::size_t Lanes::size() const { return lanes_.size(); }
const std::string& Lanes::device(std::size_t number) const {
  return lanes_.at(number - 1)->device();
}

LaneAnswer<Lanes::Lane*> Lanes::lane(std::size_t number) const {
  if (number < 1 || number > lanes_.size()) {
    return tl::unexpected<LaneRefusal>(
        {LaneRefusal::Kind::no_such_lane, fmt::format("there is no lane {}", number),
         fmt::format("lanes are numbered from 1 to {}", lanes_.size())});
  }
  return lanes_[number - 1].get();
}

LaneAnswer<void> Lanes::start(std::size_t number, const StartOrder& order) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->start(order, false) : LaneAnswer<void>(tl::unexpected(chosen.error()));
}

LaneAnswer<void> Lanes::start_capture(std::size_t number, const StartOrder& order) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->start(order, true) : LaneAnswer<void>(tl::unexpected(chosen.error()));
}

LaneAnswer<void> Lanes::say(std::size_t number, const std::string& client, OperatorWord word) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->say(client, word) : LaneAnswer<void>(tl::unexpected(chosen.error()));
}

LaneAnswer<void> Lanes::side_is_placed(std::size_t number, const std::string& client) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->side_is_placed(client)
                : LaneAnswer<void>(tl::unexpected(chosen.error()));
}

LaneAnswer<std::size_t> Lanes::scan(std::size_t number, const std::string& serial) {
  if (number == 0) {
    for (const auto& each : lanes_) {
      if (each->holds(serial)) {
        number = static_cast<std::size_t>(&each - lanes_.data()) + 1;
      }
    }
    if (number == 0) {
      return conflict(fmt::format("no lane holds a unit {}", printable(serial, 40)),
                      "plug the unit in, or look whether its label is its own");
    }
  }
  const auto chosen = lane(number);
  if (!chosen) {
    return tl::unexpected(chosen.error());
  }
  if (const auto scanned = (*chosen)->scan(serial); !scanned) {
    return tl::unexpected(scanned.error());
  }
  return number;
}

LaneAnswer<void> Lanes::take_over(std::size_t number, const std::string& client,
                                  const std::string& operator_name) {
  const auto chosen = lane(number);
  return chosen ? (*chosen)->take_over(client, operator_name)
                : LaneAnswer<void>(tl::unexpected(chosen.error()));
}

std::uint64_t Lanes::changes() const { return shared_->changes; }
std::uint64_t Lanes::changes(std::size_t number) const { return lanes_.at(number - 1)->changes(); }
LaneState Lanes::state(std::size_t number) const { return lanes_.at(number - 1)->state(); }
Json Lanes::to_json(std::size_t number) const { return lanes_.at(number - 1)->to_json(); }
LaneTrace Lanes::trace(std::size_t number, std::uint64_t first) const {
  return lanes_.at(number - 1)->trace(first);
}
Json Lanes::live(std::size_t number) const { return lanes_.at(number - 1)->live(); }

std::vector<std::size_t> Lanes::queue() const {
  std::vector<std::pair<Lane::Wait, std::size_t>> waiting;
  for (std::size_t i = 0; i < lanes_.size(); ++i) {
    const Lane::Wait wait = lanes_[i]->wait();
    if (wait.waits) {
      waiting.emplace_back(wait, i + 1);
    }
  }
  std::stable_sort(waiting.begin(), waiting.end(), [](const auto& a, const auto& b) {
    return a.first.in_hand != b.first.in_hand ? a.first.in_hand
                                              : a.first.since_ms < b.first.since_ms;
  });
  std::vector<std::size_t> numbers;
  numbers.reserve(waiting.size());
  for (const auto& [wait, number] : waiting) {
    numbers.push_back(number);
  }
  return numbers;
}

}  // namespace sixpoint::station
