#include "station/lanes/lane.h"

#include <fmt/format.h>

#include "base/sha256.h"
#include "station/lanes/order_rule.h"

namespace sixpoint::station {

namespace {

constexpr std::size_t kLogLines = 30;
constexpr std::size_t kMostCommands = 8;  // that wait for the run's thread

// The folder of a lane: the same device in the same lane finds its unfinished run again.
std::string folder_of_lane(const std::string& state_folder, std::size_t number,
                           const std::string& device) {
  return fmt::format("{}/lane-{}-{}", state_folder, number, text_sha256(device).substr(0, 8));
}

// Whose run it is, where it has a name.
std::string at_work(const std::string& operator_name) {
  return operator_name.empty()
             ? "this lane is at work already"
             : fmt::format("this lane is at work for {}", printable(operator_name, 60));
}

tl::unexpected<LaneRefusal> nothing_runs() {
  return lane_conflict("nothing runs in this lane", "start a run first");
}

}  // namespace

Lanes::Lane::Lane(Shared& shared, std::size_t number, std::string device)
    : shared_(shared),
      env_(shared.env),
      number_(number),
      device_(std::move(device)),
      folder_(env_, folder_of_lane(shared.options.state_folder, number, device_)) {
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

void Lanes::Lane::request_stop() {
  thread_.request_stop();
  {
    const std::lock_guard lock(mutex_);
    for (device::Unit* const unit : {unit_.get(), opening_}) {
      if (unit != nullptr) {
        unit->cancel();
      }
    }
  }
  wake_.notify_all();
}

Lanes::Lane::~Lane() {
  request_stop();
  thread_.join();
}

LaneAnswer<void> Lanes::Lane::start(const StartOrder& order, bool capture) {
  const std::lock_guard lock(mutex_);
  if (state_ == LaneState::absent || (!is_busy() && !unit_)) {
    return lane_conflict("no unit is plugged in here", "plug one in");
  }
  if (is_busy() || order_) {
    return lane_conflict(at_work(operator_name_), "wait for its end, or take the lane over");
  }
  if (is_unstored_) {
    return lane_conflict("the last run is not stored yet, and a second one could take its place",
                         "see to the store or to the disk; the station tries again by itself");
  }
  if (!jig_fault_.empty()) {
    return lane_conflict(fmt::format("the jig stopped: {}", jig_fault_),
                         "look at the jig; when no hand is in it, say that it is free");
  }
  if (order.last_run && unwritten_serial_ != identity_.serial) {
    return lane_conflict("the last run of this unit has no constants that wait to be written",
                         "measure the unit with 'write'");
  }
  const std::string scanned = order.serial.empty() ? scanned_ : order.serial;
  if (auto checked = check_scanned(scanned); !checked) {
    scanned_ = scanned;
    changed();
    return checked;
  }
  order_ = Order{order, capture, identity_.serial, env_.clock.elapsed()};
  operator_name_ = order.operator_name;
  client_ = order.client;
  changed();
  wake_.notify_all();
  return {};
}

LaneAnswer<void> Lanes::Lane::command(const std::string& client, OperatorCommand command) {
  const std::lock_guard lock(mutex_);
  if (auto checked = check_client(client); !checked) {
    return checked;
  }
  if (!is_busy()) {
    return nothing_runs();
  }
  if (commands_.size() < kMostCommands || command == OperatorCommand::stop) {
    commands_.push_back(command);
  }
  wake_.notify_all();
  return {};
}

LaneAnswer<void> Lanes::Lane::confirm_side(const std::string& client) {
  const std::lock_guard lock(mutex_);
  if (auto checked = check_client(client); !checked) {
    return checked;
  }
  if (state_ != LaneState::capturing || !capture_ || !capture_->side) {
    return lane_conflict("no side is asked for in this lane", "start a capture first");
  }
  capture_->placed = true;
  wake_.notify_all();
  return {};
}

LaneAnswer<void> Lanes::Lane::release_jig(const std::string& client, const std::string& name) {
  const std::lock_guard lock(mutex_);
  if (auto checked = check_client(client); !checked) {
    return checked;
  }
  if (state_ == LaneState::absent || (!is_busy() && !unit_)) {
    return lane_conflict("no unit is plugged in here, so the jig cannot be asked",
                         "plug it in, look at the jig, then say that it is free");
  }
  if (is_busy() || jig_fault_.empty()) {
    return lane_conflict(is_busy() ? "a run is under way in this lane" : "the jig is free",
                         "a jig is released after it was stopped, when no run is under way");
  }
  release_ = Release{jig_fault_, name, env_.clock.elapsed()};
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
  return state_ == LaneState::absent ? LaneAnswer<void>() : check_scanned(serial);
}

LaneAnswer<void> Lanes::Lane::take_over(const std::string& client,
                                        const std::string& operator_name) {
  const std::lock_guard lock(mutex_);
  if (!is_busy()) {
    return nothing_runs();
  }
  client_ = client;
  if (!operator_name.empty()) {
    operator_name_ = operator_name;
  }
  changed();
  return {};
}

Lanes::Lane::Wait Lanes::Lane::wait() const {
  const std::lock_guard lock(mutex_);
  Wait wait;
  wait.since_ms = waiting_since_ms_;
  if (state_ == LaneState::capturing) {
    wait.waits = capture_ && capture_->side && !capture_->placed;
  } else if (state_ == LaneState::running && !turns_by_itself_ && run_ && run_->wanted) {
    wait.is_moved = live_.stillness == JigStillness::moving;
    wait.waits = wait.is_moved || live_.stillness == JigStillness::leaving;
  } else {
    wait.waits = state_ == LaneState::unit_away || state_ == LaneState::wrong_unit;
  }
  return wait;
}

LaneAnswer<void> Lanes::Lane::check_client(const std::string& client) const {
  if (is_busy() && client != client_) {
    return lane_conflict(at_work(operator_name_), "take the lane over first");
  }
  return {};
}

LaneAnswer<void> Lanes::Lane::check_scanned(const std::string& serial) const {
  if (!serial.empty() && serial != identity_.serial) {
    return lane_conflict(fmt::format("{} was scanned, but the unit says that it is {}",
                                     printable(serial, 40), printable(identity_.serial, 40)),
                         "put the right unit in, or scan the label of this one");
  }
  return {};
}

void Lanes::Lane::drop_order(const std::optional<std::string>& present) {
  if (!order_) {
    return;
  }
  if (const auto dead = why_order_is_dead({order_->serial, age_s(order_->given), present})) {
    order_.reset();
    add_log("problem", *dead);
  }
}

void Lanes::Lane::drop_what_waits() {
  drop_order({});
  if (std::exchange(release_, std::nullopt)) {
    add_log("problem", "not released: the unit with its jig left; look at the jig again");
  }
}

void Lanes::Lane::add_log(std::string kind, std::string text) {
  log_.push_back({++log_lines_, std::move(kind), std::move(text), unix_ms(env_.clock.now())});
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

void Lanes::Lane::set_done(nlohmann::ordered_json result, std::string message) {
  result_ = std::move(result);
  set_state(LaneState::done, std::move(message));
  changed();
}

std::optional<OperatorCommand> Lanes::Lane::next_command() {
  const std::lock_guard lock(mutex_);
  if (commands_.empty()) {
    return std::nullopt;
  }
  const OperatorCommand command = commands_.front();
  commands_.pop_front();
  return command;
}

}  // namespace sixpoint::station
