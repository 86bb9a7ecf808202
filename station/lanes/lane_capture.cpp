// A calibration file in a lane, and how it continues after a replug or a restart of the program.
#include <fmt/format.h>

#include "station/lanes/lane.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

// While the operator turns the unit: between two checks whether it is still plugged in.
constexpr double kCheckUnit_s = 0.5;

Json result_of(const std::string& serial, const char* verdict, std::vector<std::string> reasons) {
  return {{"kind", "capture"},
          {"serial", serial},
          {"stored", false},
          {"verdict", verdict},
          {"reasons", std::move(reasons)}};
}

Json result_of(const CaptureReport& report) {
  const char* verdict = report.stopped            ? "stopped"
                        : !report.refusal.empty() ? "refused"
                        : report.usable()         ? "pass"
                                                  : "fail";
  Json result = result_of(report.serial, verdict,
                          report.solved ? report.solved->verification.reasons : report.refusal);
  result["notes"] = report.notes;
  result["file"] = report.file;
  result["repeat_sides"] =
      report.solved ? Json(report.solved->verification.missing_directions) : Json::array();
  return result;
}

Json result_of(const Error& error, const std::string& serial, bool stopped) {
  return result_of(serial, stopped ? "stopped" : "inconclusive", {error.brief()});
}

}  // namespace

// Waits for the operator in short pieces, so that a unit that is pulled out meanwhile is noticed.
SideAnswer Lanes::Lane::ask_side(const std::stop_token& stop, device::Pose side,
                                 std::size_t number) {
  std::unique_lock lock(mutex_);
  if (capture_->side != side) {
    capture_ = CaptureView{
        side, number, turns_by_itself_, env_.clock.elapsed(), 0, std::move(capture_->again)};
    waiting_since_ms_ = unix_ms(env_.clock.now());
    changed();
  }
  wake_.wait_for(lock, stop, from_seconds(kCheckUnit_s),
                 [&] { return capture_->placed || has_stop_command(); });
  if (stop.stop_requested()) {
    return SideAnswer::leave;
  }
  if (has_stop_command()) {
    return SideAnswer::stop;
  }
  if (capture_->placed) {
    const CaptureOptions& options = shared_.options.capture;
    capture_->until_ms = unix_ms(env_.clock.now()) + 1000 * (options.turn_s + options.side_s);
    changed();
    return SideAnswer::placed;
  }
  // A unit that waits for hours must not record until its battery is empty.
  return age_s(capture_->asked) > shared_.options.unit_wait_s ? SideAnswer::stop
                                                              : SideAnswer::waiting;
}

UnfinishedCapture Lanes::Lane::new_capture(const StartOrder& order) const {
  std::string time = to_iso8601(env_.clock.now()).substr(0, 19);
  std::replace(time.begin(), time.end(), ':', '-');
  UnfinishedCapture capture;
  capture.serial = identity_.serial;
  capture.operator_name = order.operator_name;
  capture.client = order.client;
  capture.output = fmt::format("{}/{}-calibration-{}.gt3x", shared_.options.capture_folder,
                               printable(identity_.serial, 20), time);
  return capture;
}

CaptureHooks Lanes::Lane::capture_hooks(const std::stop_token& stop, UnfinishedCapture& state) {
  CaptureHooks hooks;
  hooks.ask = [&](device::Pose side, std::size_t number, std::size_t /*of*/) {
    return ask_side(stop, side, number);
  };
  hooks.next_answer = [&] {
    return stop.stop_requested() ? SideAnswer::leave
           : stop_requested()    ? SideAnswer::stop
                                 : SideAnswer::placed;
  };
  hooks.progress = [&](const CaptureResume& resume) {
    state.resume = resume;
    const Status saved = folder_.save_capture(state);
    const std::lock_guard lock(mutex_);
    capture_->side.reset();
    if (!saved) {
      add_log("problem", "this capture would not survive a restart: " + saved.error().brief());
    }
    changed();
  };
  if (!turns_by_itself_) {  // a jig would lay it the same way again
    hooks.again = [&](const std::vector<device::Pose>& sides) {
      const std::lock_guard lock(mutex_);
      capture_->again = sides;
      std::string names;
      for (const device::Pose side : sides) {
        names += ' ';
        names += device::to_string(side);
      }
      add_log("again", "too few still readings, asked for again:" + names);
      changed();
    };
  }
  hooks.reopen = [&](const Error& error) {
    {
      const std::lock_guard lock(mutex_);
      capture_->side.reset();
      changed();
    }
    return wait_for_unit(stop, state.serial, error.what, LaneState::capturing, {});
  };
  return hooks;
}

void Lanes::Lane::capture(const std::stop_token& stop, const StartOrder& order,
                          const std::optional<UnfinishedCapture>& left) {
  UnfinishedCapture state = left ? *left : new_capture(order);
  CaptureOptions options = shared_.options.capture;
  options.output = state.output;
  {
    const std::lock_guard lock(mutex_);
    capture_ = CaptureView{};
    changed();
  }
  if (!left) {  // the unit of one that goes on records already
    if (const auto allowed = check_start(state.serial); !allowed) {
      return end_capture(
          result_of(state.serial, "refused", {allowed.error().what, allowed.error().hint}));
    }
  }
  {
    const std::lock_guard lock(mutex_);
    forget_unwritten();
  }
  const auto report = run_capture(on_jig(), env_, options, capture_hooks(stop, state),
                                  left ? std::optional(left->resume) : std::nullopt);
  if (!report && stop.stop_requested()) {
    return;  // the next program continues it
  }
  end_capture_with(report, state.serial);
  if (!report && report.error().code == ErrorCode::device_unavailable) {
    close_unit();
  }
}

void Lanes::Lane::end_capture_with(const Result<CaptureReport>& report, const std::string& serial) {
  if (!report) {
    return end_capture_by(report.error(), serial);
  }
  Json result = result_of(*report);
  std::string said;
  if (report->usable()) {
    const std::lock_guard lock(shared_.store_mutex);
    const auto stored = shared_.store_constants(*report);
    if (stored) {
      result["stored"] = true;
      result["constants_id"] = stored->id;
      said = stored->said;
    }
    if (!stored || stored->file_problem) {
      result["problem"] = (stored ? *stored->file_problem : stored.error()).brief();
    }
  }
  if (!said.empty()) {
    const std::lock_guard lock(mutex_);
    add_log("problem", std::move(said));
  }
  end_capture(std::move(result));
}

void Lanes::Lane::end_capture(Json result) {
  const Status cleared = folder_.clear_capture();
  const std::lock_guard lock(mutex_);
  capture_.reset();
  if (!cleared) {
    add_log("problem", cleared.error().brief());
  }
  set_done(std::move(result), "");
}

void Lanes::Lane::end_capture_by(const Error& error, const std::string& serial) {
  end_capture(result_of(error, serial, stop_requested()));
}

// Its unit recorded on, or holds what it recorded until then.
void Lanes::Lane::continue_capture(const std::stop_token& stop, const UnfinishedCapture& left) {
  const StartOrder order = {left.operator_name, false, left.client, left.serial};
  {
    const std::lock_guard lock(mutex_);
    capture_ = CaptureView{};
  }
  const auto unit = wait_to_continue(stop, order, "recording", LaneState::capturing);
  if (stop.stop_requested()) {
    return;
  }
  if (!unit && left.resume.asked_again == 0) {
    return end_capture_by(unit.error(), left.serial);
  }
  if (!unit) {
    CaptureOptions options = shared_.options.capture;
    options.output = left.output;
    CaptureReport report;
    report.serial = left.serial;
    return end_capture_with(judge_file_of_before(env_, options, report, unit.error().brief()),
                            left.serial);
  }
  capture(stop, order, left);
}

}  // namespace sixpoint::station
