// The thread of a lane: the unit is plugged in, previewed and pulled out; orders are carried out.
#include <fmt/format.h>

#include "device/wire/wire_unit.h"
#include "station/lanes/lane.h"
#include "station/lanes/order_rule.h"

namespace sixpoint::station {

namespace {

using std::chrono::milliseconds;

constexpr std::size_t kTraceSeconds = 6;
constexpr double kMostShown_mg = 32000;  // of a reading, far above the sensor's range
// A virtual unit whose time runs this much faster than the machine's needs a pause.
constexpr int kFastClock = 10;
constexpr double kFastClockPause_s = 0.06;
constexpr double kDefectPause_s = 2;

}  // namespace

void Lanes::Lane::work(const std::stop_token& stop) {
  const auto guarded = [this, &stop](auto step) {
    try {
      step();
    } catch (const std::exception& defect) {
      end_by_defect(defect.what());
      pause(stop, kDefectPause_s);
    }
  };
  guarded([&] { continue_unfinished(stop); });
  while (!stop.stop_requested()) {
    guarded([&] { work_once(stop); });
  }
  static_cast<void>(folder_.close());
}

void Lanes::Lane::work_once(const std::stop_token& stop) {
  store_result(stop);
  if (!unit_ && !open_unit()) {
    pause(stop, shared_.options.retry_s);
    return;
  }
  look_at_jig();
  const std::optional<Order> order = next_order();
  if (!order) {
    preview(stop);
  } else if (order->start.last_run) {
    write_last(stop, order->start);
  } else if (order->capture) {
    capture(stop, order->start, {});
  } else {
    run(stop, order->start, {});
  }
}

// The libraries return errors as values: an exception is a defect of this program. It ends what
// this lane was doing, and nothing of the others.
void Lanes::Lane::end_by_defect(const std::string& what) {
  const Error error{
      ErrorCode::internal,
      fmt::format("a defect of the program ended this lane's work: {}", printable(what)),
      {},
      "please report it; the other lanes go on"};
  bool was_busy = false;
  bool was_capture = false;
  std::string serial;
  {
    const std::lock_guard lock(mutex_);
    add_log("problem", error.brief());
    opening_ = nullptr;
    was_busy = is_busy();
    was_capture = capture_.has_value();
    serial = identity_.serial;
  }
  if (was_busy && unit_ && unit_->jig() != nullptr && unit_->jig()->turns_by_itself()) {
    static_cast<void>(unit_->jig()->stop());  // no one watches it any more
  }
  if (was_capture && unit_) {
    static_cast<void>(unit_->stop_recording());  // it would empty its battery
  }
  if (was_capture) {
    end_capture_by(error, serial);
  } else if (was_busy) {
    end_without_report(serial, error);
  }
  close_unit();
}

// What an earlier program left on the disk.
void Lanes::Lane::continue_unfinished(const std::stop_token& stop) {
  const auto say = [this](const Error& error, const Status& moved) {
    const std::lock_guard lock(mutex_);
    add_log("problem", error.brief() + (moved ? "; it is set aside" : ""));
  };
  if (const auto left = folder_.load(); !left) {
    say(left.error(), folder_.set_aside_run());
  } else if (*left) {
    continue_run(stop, **left);
  }
  if (const auto left = folder_.load_capture(); !left) {
    say(left.error(), folder_.set_aside_capture());
  } else if (*left && !stop.stop_requested()) {
    continue_capture(stop, **left);
  }
}

// Takes the order that waits, and prepares what clients are shown for it. The unit is asked who it
// is: it may have been exchanged since.
std::optional<Lanes::Lane::Order> Lanes::Lane::next_order() {
  bool waits = false;
  {
    const std::lock_guard lock(mutex_);
    waits = order_.has_value();
  }
  std::optional<std::string> present;
  if (waits) {
    if (is_streaming_) {
      static_cast<void>(unit_->stop_stream());
      is_streaming_ = false;
    }
    if (const auto identity = unit_->identify()) {
      present = identity->serial;
    }
  }
  const std::lock_guard lock(mutex_);
  if (waits) {
    drop_order(present);
  }
  if (order_ && is_unstored_) {
    order_.reset();
    add_log("problem", "not started: the last run is not stored yet");
  }
  if (state_ == LaneState::absent) {
    set_state(LaneState::idle, "");
  }
  auto order = std::exchange(order_, std::nullopt);
  commands_.clear();
  if (order) {
    write_ = order->start.write;
    result_ = nullptr;
    run_.reset();
    log_.clear();
    set_state(order->capture ? LaneState::capturing : LaneState::running, "");
  }
  return order;
}

void Lanes::Lane::pause(const std::stop_token& stop, double time_s) {
  std::unique_lock lock(mutex_);
  const std::size_t commands = commands_.size();
  wake_.wait_for(lock, stop, from_seconds(time_s),
                 [&] { return commands_.size() != commands || order_.has_value(); });
}

void Lanes::Lane::look_at_jig() {
  device::Jig* const jig = unit_->jig();
  if (jig == nullptr || !jig->turns_by_itself()) {
    return;
  }
  const auto fault_of = [jig] {
    const auto position = jig->position();
    return position ? position->fault : position.error().brief();
  };
  std::string fault = fault_of();
  std::optional<Release> release;
  {
    const std::lock_guard lock(mutex_);
    release = std::exchange(release_, std::nullopt);
  }
  std::optional<std::string> problem;
  if (release) {
    problem = why_release_is_dead({release->fault, age_s(release->given), fault});
    if (!problem) {
      if (const Status released = jig->release(); !released) {
        problem = released.error().brief();
      }
      fault = fault_of();
    }
  }
  const std::lock_guard lock(mutex_);
  if (release) {
    add_log(problem ? "problem" : "jig",
            problem.value_or(
                fmt::format("{} says that the jig is free",
                            release->name.empty() ? "someone" : printable(release->name, 60))));
  }
  if (fault != jig_fault_) {
    jig_fault_ = fault;
    changed();
  }
}

UnitOnJig Lanes::Lane::on_jig() {
  return {unit_.get(), unit_->jig() != nullptr ? unit_->jig() : &manual_jig_};
}

// True when a unit is there and identifies itself.
bool Lanes::Lane::open_unit() {
  auto opened = shared_.devices.open(device_, env_).and_then([](device::Link link) {
    return device::WireUnit::open(std::move(link));
  });
  if (!opened) {
    const std::lock_guard lock(mutex_);
    is_streaming_ = false;
    if (!is_busy()) {
      set_state(LaneState::absent, opened.error().brief());
    }
    drop_what_waits();
    return false;
  }
  std::unique_ptr<device::Unit> unit = *std::move(opened);
  const auto set_opening = [this](device::Unit* now) {
    const std::lock_guard lock(mutex_);
    opening_ = now;
  };
  set_opening(unit.get());
  std::optional<StoredConstants> stored;
  if (const auto page = unit->read_calibration()) {
    stored = page->constants;
  }
  const std::lock_guard lock(mutex_);
  opening_ = nullptr;
  is_streaming_ = false;
  if (unit->identity().serial != identity_.serial) {
    // Another unit: nothing of the one before stays on the lane but what went wrong.
    if (!is_busy()) {
      // What came out of the one before stays to be read until the next start; its constants are
      // for its own unit alone.
      run_.reset();
      forget_unwritten();
      std::erase_if(log_, [](const LogLine& line) { return line.kind != "problem"; });
    }
    readings_.clear();
  }
  last_sample_ = unit->clock().elapsed();
  turns_by_itself_ = unit->jig() != nullptr && unit->jig()->turns_by_itself();
  identity_ = unit->identity();
  approximation_ = first_approximation(stored).calibration;
  live_ = {};
  unit_ = std::move(unit);
  changed();
  return true;
}

void Lanes::Lane::close_unit() {
  const std::lock_guard lock(mutex_);
  unit_.reset();
  live_ = {};
  drop_what_waits();
}

void Lanes::Lane::add_readings(const device::SampleBlock& block, const JigLive* live) {
  const std::lock_guard lock(mutex_);
  const auto most = kTraceSeconds * static_cast<std::size_t>(shared_.options.session.run.rate_hz);
  PerAxis<double> sum_mg{};
  for (const device::RawCounts& counts : block.counts) {
    PerAxis<std::int16_t> force_mg{};
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double mg = (counts[axis] - approximation_.zero_lsb[axis]) *
                        approximation_.sensitivity_g_per_lsb[axis] * kMgPerG;
      force_mg[axis] =
          static_cast<std::int16_t>(std::clamp(std::round(mg), -kMostShown_mg, kMostShown_mg));
      sum_mg[axis] += mg;
    }
    readings_.push_back(force_mg);
    ++readings_taken_;
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

// False where the unit does not stream now, or has gone.
bool Lanes::Lane::start_preview(const std::stop_token& stop) {
  const Status started = unit_->start_stream(shared_.options.session.run.rate_hz);
  if (started) {
    is_streaming_ = true;
    last_sample_ = unit_->clock().elapsed();
    return true;
  }
  // A unit that records does not stream: whether it is still there, its identity shows.
  if (started.error().code == ErrorCode::device_unavailable || !unit_->identify()) {
    close_unit();
  } else {
    pause(stop, shared_.options.silence_s);
  }
  return false;
}

// Shows the unit's readings while nothing runs, and notices when it is pulled out.
void Lanes::Lane::preview(const std::stop_token& stop) {
  if (!is_streaming_ && !start_preview(stop)) {
    return;
  }
  const auto machine_before = env_.clock.elapsed();
  const auto unit_before = unit_->clock().elapsed();
  const auto block = unit_->next_samples(milliseconds(100));
  const auto unit_now = unit_->clock().elapsed();
  if (!block || (!*block && unit_now - last_sample_ > from_seconds(shared_.options.silence_s))) {
    close_unit();
    return;
  }
  if (*block) {
    last_sample_ = unit_now;
    add_readings(**block, nullptr);
  }
  // Without the pause, such a unit would keep a core busy.
  if (unit_now - unit_before > kFastClock * (env_.clock.elapsed() - machine_before)) {
    pause(stop, kFastClockPause_s);
  }
}

// After a restart of the program; `what`: run or recording.
Result<UnitOnJig> Lanes::Lane::wait_to_continue(const std::stop_token& stop,
                                                const StartOrder& order, const char* what,
                                                LaneState working) {
  {
    const std::lock_guard lock(mutex_);
    operator_name_ = order.operator_name;
    client_ = order.client;
    write_ = order.write;
    identity_.serial = order.serial;
    set_state(LaneState::resuming, fmt::format("waits for unit {} to go on with its {}",
                                               printable(order.serial, 40), what));
  }
  return wait_for_unit(stop, order.serial,
                       fmt::format("the program was started again; the {} goes on", what), working,
                       {});
}

Result<UnitOnJig> Lanes::Lane::wait_for_unit(const std::stop_token& stop, const std::string& serial,
                                             const std::string& why, LaneState working,
                                             const JigHooks::Look& look) {
  // A jig that is part of its unit stays open: it can be stopped while the unit is away.
  std::unique_ptr<device::Unit> with_jig;
  if (const std::lock_guard lock(mutex_); unit_ && unit_->jig() != nullptr) {
    with_jig = std::move(unit_);
  }
  close_unit();
  const auto deadline = env_.clock.elapsed() + from_seconds(shared_.options.unit_wait_s);
  const std::string asked = fmt::format("plug unit {} in again", printable(serial, 40));
  {
    const std::lock_guard lock(mutex_);
    waiting_since_ms_ = unix_ms(env_.clock.now());
    set_state(LaneState::unit_away, asked);
    add_log("away", why);
  }
  while (!stop.stop_requested()) {
    if (look) {
      SIXPOINT_CHECK(look());
    }
    if (stop_requested()) {
      return fail(ErrorCode::device_unavailable, "stopped by the operator");
    }
    if (env_.clock.elapsed() > deadline) {
      return fail(
          ErrorCode::device_unavailable,
          fmt::format("the unit did not come back within {:.0f} s", shared_.options.unit_wait_s));
    }
    const bool is_open = open_unit();
    const std::string found = is_open ? unit_->identity().serial : "";
    if (is_open && found != serial) {
      close_unit();
    }
    {
      const std::lock_guard lock(mutex_);
      if (is_open && found == serial) {
        set_state(working, "");
        add_log("back", "the unit is back; it goes on");
        return on_jig();
      }
      if (is_open) {
        set_state(LaneState::wrong_unit,
                  fmt::format("this is {0}, and the run is of {1}: put {1} back, or stop the run",
                              printable(found, 40), printable(serial, 40)));
      } else {
        set_state(LaneState::unit_away, asked);
      }
    }
    pause(stop, shared_.options.retry_s);
  }
  return fail(ErrorCode::internal, "the program ends");
}

}  // namespace sixpoint::station
