#include "station/lane.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/sha256.h"
#include "gt3x/model.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;
using std::chrono::milliseconds;

constexpr std::size_t kTraceSeconds = 6;
constexpr std::size_t kLogLines = 30;

// The folder of a lane: the same device in the same lane finds what it left.
std::string folder_of_lane(const std::string& state_folder, std::size_t number,
                           const std::string& device) {
  const auto digest =
      sha256(std::span(reinterpret_cast<const std::uint8_t*>(device.data()), device.size()));
  return fmt::format("{}/lane-{}-{}", state_folder, number, to_hex(std::span(digest).first(4)));
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

Lanes::Lane::Lane(Shared& shared, std::size_t number, std::string device)
    : shared_(shared),
      env_(shared.env),
      number_(number),
      device_(std::move(device)),
      folder_(env_, folder_of_lane(shared.options.state_folder, number, device_)) {
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

Lanes::Lane::~Lane() {
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

LaneAnswer<void> Lanes::Lane::start(const StartOrder& order, bool capture) {
  const std::lock_guard lock(mutex_);
  if (order_ || (state_ != LaneState::idle && state_ != LaneState::done)) {
    if (state_ == LaneState::absent) {
      return lane_conflict("no unit is plugged in here", "plug one in");
    }
    return lane_conflict(fmt::format("this lane is at work for {}", printable(operator_name_, 60)),
                         "wait for its end, or take the lane over");
  }
  const std::string scanned = order.serial.empty() ? scanned_ : order.serial;
  if (!scanned.empty() && scanned != identity_.serial) {
    scanned_ = scanned;
    changed();
    return lane_conflict(fmt::format("{} was scanned, but the unit says that it is {}",
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

LaneAnswer<void> Lanes::Lane::say(const std::string& client, OperatorWord word) {
  const std::lock_guard lock(mutex_);
  if (auto mine = obeys(client); !mine) {
    return mine;
  }
  if (!is_busy()) {
    return lane_conflict("nothing runs in this lane", "start a run first");
  }
  if (words_.size() < 8) {
    words_.push_back(word);
  }
  wake_.notify_all();
  return {};
}

LaneAnswer<void> Lanes::Lane::side_is_placed(const std::string& client) {
  const std::lock_guard lock(mutex_);
  if (auto mine = obeys(client); !mine) {
    return mine;
  }
  if (state_ != LaneState::capturing || !asked_side_) {
    return lane_conflict("no side is asked for in this lane", "start a capture first");
  }
  side_placed_ = true;
  wake_.notify_all();
  return {};
}

LaneAnswer<void> Lanes::Lane::scan(const std::string& serial) {
  const std::lock_guard lock(mutex_);
  if (is_busy() || order_) {
    return lane_conflict("a run is under way in this lane", "scan before the run");
  }
  scanned_ = serial;
  changed();
  if (state_ != LaneState::absent && serial != identity_.serial) {
    return lane_conflict(fmt::format("{} was scanned, but the unit says that it is {}",
                                     printable(serial, 40), printable(identity_.serial, 40)),
                         "put the right unit in, or scan the label of this one");
  }
  return {};
}

LaneAnswer<void> Lanes::Lane::take_over(const std::string& client,
                                        const std::string& operator_name) {
  const std::lock_guard lock(mutex_);
  if (!is_busy()) {
    return lane_conflict("nothing runs in this lane", "start a run first");
  }
  client_ = client;
  if (!operator_name.empty()) {
    operator_name_ = operator_name;
  }
  changed();
  return {};
}

LaneTrace Lanes::Lane::trace(std::uint64_t first) const {
  const std::lock_guard lock(mutex_);
  LaneTrace trace;
  const std::uint64_t oldest = taken_ - readings_.size();
  trace.first = std::clamp(first, oldest, taken_);
  trace.force_mg.assign(readings_.begin() + static_cast<std::ptrdiff_t>(trace.first - oldest),
                        readings_.end());
  trace.host_ms = newest_ms_;
  return trace;
}

Json Lanes::Lane::live() const {
  const std::lock_guard lock(mutex_);
  Json json;
  json["stillness"] = station::to_string(live_.stillness);
  json["dwell"] = std::round(live_.dwell_fraction * 100) / 100;
  json["face"] = live_.face ? Json(device::to_string(live_.face->pose)) : Json(nullptr);
  json["angle_deg"] =
      live_.face ? Json(std::round(live_.face->angle_deg * 10) / 10) : Json(nullptr);
  return json;
}

Lanes::Lane::Wait Lanes::Lane::wait() const {
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

LaneAnswer<void> Lanes::Lane::obeys(const std::string& client) const {
  if (is_busy() && client != client_) {
    return lane_conflict(fmt::format("this lane is at work for {}", printable(operator_name_, 60)),
                         "take the lane over first");
  }
  return {};
}

void Lanes::Lane::tell(std::string kind, std::string text) {
  log_.push_back({++lines_, std::move(kind), std::move(text), unix_ms(env_.clock.now())});
  if (log_.size() > kLogLines) {
    log_.pop_front();
  }
  changed();
}

void Lanes::Lane::set_state(LaneState state, std::string message) {
  if (state != state_ || message != message_) {
    state_ = state;
    message_ = std::move(message);
    changed();
  }
}

std::optional<OperatorWord> Lanes::Lane::take_word() {
  const std::lock_guard lock(mutex_);
  if (words_.empty()) {
    return std::nullopt;
  }
  const OperatorWord word = words_.front();
  words_.pop_front();
  return word;
}

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
  if (has_capture_) {
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
    auto capture_left = folder_.load_capture();
    if (!capture_left) {
      const std::lock_guard lock(mutex_);
      tell("problem", capture_left.error().brief());
      static_cast<void>(folder_.set_aside());
    } else if (*capture_left && !stop.stop_requested()) {
      resume_capture(stop, **capture_left);
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
        capture(stop, *order, {});
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
                                             const std::string& why, LaneState working) {
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
        set_state(working, "");
        tell("back", "the unit is back; it goes on");
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

}  // namespace sixpoint::station
