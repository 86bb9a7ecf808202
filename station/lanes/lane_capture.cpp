// A calibration file in a lane, and its going on after a replug or a restart of the program.
#include <algorithm>

#include <fmt/format.h>

#include "station/lane.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// Between two looks whether the unit that somebody has in hand is still plugged in.
constexpr double kLook_s = 0.5;

Json result_of(const CaptureReport& report) {
  Json result;
  result["kind"] = "capture";
  result["serial"] = report.serial;
  result["stored"] = false;
  result["verdict"] = report.stopped            ? "stopped"
                      : !report.refusal.empty() ? "refused"
                      : report.usable()         ? "pass"
                                                : "fail";
  result["reasons"] = report.solved ? report.solved->verification.reasons : report.refusal;
  result["notes"] = report.notes;
  result["file"] = report.file;
  result["repeat_sides"] =
      report.solved ? Json(report.solved->verification.missing_directions) : Json::array();
  return result;
}

Json result_of(const Error& error, const std::string& serial, bool stopped) {
  Json result;
  result["kind"] = "capture";
  result["serial"] = serial;
  result["stored"] = false;
  result["verdict"] = stopped ? "stopped" : "inconclusive";
  result["reasons"] = {error.brief()};
  return result;
}

}  // namespace

// Waits for the person in short pieces, so that a unit that is pulled out meanwhile is noticed.
SideAnswer Lanes::Lane::ask_side(const std::stop_token& stop, device::Pose side,
                                 std::size_t number) {
  std::unique_lock lock(mutex_);
  if (asked_side_ != side) {
    asked_side_ = side;
    side_number_ = number;
    side_until_ms_ = 0;
    side_placed_ = turns_by_itself_;
    waiting_since_ms_ = unix_ms(env_.clock.now());
    changed();
  }
  const auto stop_said = [&] {
    return std::find(words_.begin(), words_.end(), OperatorWord::stop) != words_.end();
  };
  wake_.wait_for(lock, stop, from_seconds(kLook_s), [&] { return side_placed_ || stop_said(); });
  if (stop.stop_requested()) {
    return SideAnswer::leave;
  }
  if (stop_said()) {
    return SideAnswer::stop;
  }
  if (side_placed_) {
    const CaptureOptions& options = shared_.options.capture;
    side_until_ms_ = unix_ms(env_.clock.now()) + 1000 * (options.turn_s + options.side_s);
    changed();
    return SideAnswer::placed;
  }
  // A unit left on the bench over lunch must not record until it is empty.
  const double waited_s = (unix_ms(env_.clock.now()) - waiting_since_ms_) / 1000;
  return waited_s > shared_.options.unit_wait_s ? SideAnswer::stop : SideAnswer::waiting;
}

void Lanes::Lane::capture(const std::stop_token& stop, const Order& order,
                          const std::optional<UnfinishedCapture>& left) {
  CaptureOptions options = shared_.options.capture;
  UnfinishedCapture state;
  if (left) {
    state = *left;
  } else {
    const std::string day = to_iso8601(env_.clock.now()).substr(0, 19);
    std::string name = fmt::format("{}-calibration-{}.gt3x", printable(identity_.serial, 20), day);
    std::replace(name.begin(), name.end(), ':', '-');
    state.serial = identity_.serial;
    state.operator_name = order.start.operator_name;
    state.client = order.start.client;
    state.output = shared_.options.capture_folder + "/" + name;
  }
  options.output = state.output;
  {
    const std::lock_guard lock(mutex_);
    has_capture_ = true;
    asked_side_.reset();
    changed();
  }
  CaptureHooks hooks;
  hooks.ask = [&](device::Pose side, std::size_t number, std::size_t /*of*/) {
    return ask_side(stop, side, number);
  };
  hooks.word = [&] {
    return stop.stop_requested() ? SideAnswer::leave
           : stop_was_said()     ? SideAnswer::stop
                                 : SideAnswer::placed;
  };
  hooks.progress = [&](const CaptureResume& resume) {
    state.resume = resume;
    const Status saved = folder_.save_capture(state);
    const std::lock_guard lock(mutex_);
    asked_side_.reset();
    if (!saved) {
      tell("problem", "this capture would not survive a restart: " + saved.error().brief());
    }
    changed();
  };
  hooks.reopen = [&](const Error& error) {
    {
      const std::lock_guard lock(mutex_);
      asked_side_.reset();
      changed();
    }
    return wait_for_unit(stop, state.serial, error.what, LaneState::capturing);
  };
  const auto report = run_capture(on_jig(), env_, options, hooks,
                                  left ? std::optional(left->resume) : std::nullopt);
  if (!report && stop.stop_requested()) {
    return;  // goes on at the next start of the program
  }
  Json result =
      report ? result_of(*report) : result_of(report.error(), state.serial, stop_was_said());
  if (report && report->usable()) {
    const std::lock_guard lock(shared_.store);
    if (const auto id = shared_.keep_capture(*report)) {
      result["stored"] = true;
      result["constants_id"] = *id;
    } else {
      result["problem"] = id.error().brief();
    }
  }
  end_capture(std::move(result));
  if (!report && report.error().code == ErrorCode::device_unavailable) {
    close_unit();
  }
}

void Lanes::Lane::end_capture(Json result) {
  const Status cleared = folder_.clear_capture();
  const std::lock_guard lock(mutex_);
  has_capture_ = false;
  asked_side_.reset();
  side_until_ms_ = 0;
  result_ = std::move(result);
  if (!cleared) {
    tell("problem", cleared.error().brief());
  }
  set_state(LaneState::done, "");
  changed();
}

// A capture that an earlier program left: its unit recorded on, or kept what it had.
void Lanes::Lane::resume_capture(const std::stop_token& stop, const UnfinishedCapture& left) {
  {
    const std::lock_guard lock(mutex_);
    operator_name_ = left.operator_name;
    client_ = left.client;
    has_capture_ = true;
    identity_.serial = left.serial;
    set_state(LaneState::resuming, fmt::format("waits for unit {} to go on with its recording",
                                               printable(left.serial, 40)));
  }
  const auto unit =
      wait_for_unit(stop, left.serial, "the program was started again; the recording goes on",
                    LaneState::capturing);
  if (stop.stop_requested()) {
    return;
  }
  if (!unit) {
    end_capture(result_of(unit.error(), left.serial, stop_was_said()));
    return;
  }
  capture(stop, {{left.operator_name, left.client, left.serial, false}, true}, left);
}

}  // namespace sixpoint::station
