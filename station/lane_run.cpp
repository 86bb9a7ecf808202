// A jig run in a lane, and its going on after a restart of the program.
#include <fmt/format.h>

#include "station/lane.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

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

}  // namespace

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
    {
      // The unit's own constants may be wrong by 25 degrees; what the run has seen is not.
      const calib::Calibration known = machine.approximation();
      const std::lock_guard lock(mutex_);
      approximation_ = known;
    }
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
  hooks.reopen = [&](const Error& error) {
    return wait_for_unit(stop, state.serial, error.what, LaneState::running);
  };

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
  result["next_actions"] = report.usable() ? Json::array() : Json(next_actions(report.codes));
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
  const auto unit = wait_for_unit(
      stop, left.serial, "the program was started again; the run goes on", LaneState::running);
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

}  // namespace sixpoint::station
