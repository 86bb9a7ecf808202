// A calibration file in a lane.
#include <algorithm>

#include <fmt/format.h>

#include "station/lane.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

}  // namespace

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

}  // namespace sixpoint::station
