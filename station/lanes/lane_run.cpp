// A jig run in a lane, and how it continues after a restart of the program.
#include <array>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "station/lanes/continue_rule.h"
#include "station/lanes/lane.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kStoreRetry_s = 2;

// In the order of JigAction::Kind.
constexpr std::array<const char*, 7> kLogKinds = {"place", "accepted", "refused", "dropped",
                                                  "fit",   "write",    "finished"};

Json json_of(const JigReport& report) {
  Json json;
  json["kind"] = "jig";
  json["serial"] = report.serial;
  json["verdict"] = to_string(report.verdict);
  json["reasons"] = report.reasons;
  json["next_actions"] =
      report.usable() ? Json::array() : Json(next_actions(report.codes, report.is_last_failure));
  json["residual_mg"] =
      report.verification.poses.empty() ? Json(nullptr) : Json(report.verification.worst_mg);
  json["as_found_residual_mg"] =
      report.as_found_residual_mg ? Json(*report.as_found_residual_mg) : Json(nullptr);
  json["written"] = report.written;
  json["write_begun"] = report.write_begun;
  json["refusals"] = report.refusals;
  json["coverage_factor"] = report.limits.decision.coverage_factor;
  json["quantities"] = Json::array();
  for (const JudgedQuantity& quantity : report.quantities) {
    json["quantities"].push_back(to_json(quantity));
    const QuantityInfo* const info = find_quantity(quantity.name);
    json["quantities"].back()["title"] = info != nullptr ? info->title : quantity.name;
    json["quantities"].back()["unit"] = info != nullptr ? info->unit : "";
  }
  json["stored"] = false;
  return json;
}

// The inconclusive report of a run that ended with its program and whose unit did not come back.
JigReport interrupted_report(const UnfinishedRun& left, const JigSessionOptions& options,
                             UtcTime ended, const std::string& reason, ErrorCode code) {
  const JigResume& resume = left.resume;
  JigReport report;
  report.codes = {interruption(code)};
  report.reasons.push_back(reason);
  report.serial = left.serial;
  report.firmware = left.firmware;
  report.filter = left.filter;
  report.jig = left.jig;
  report.started = resume.started;
  report.ended = ended;
  report.gravity = options.gravity;
  report.limits = options.limits;
  report.faces = resume.progress.faces;
  report.as_found = resume.as_found;
  report.as_left = resume.written;
  report.written = resume.written.has_value();
  report.write_begun = resume.write_begun;
  report.stream = resume.stream;
  report.settle_as_left();
  report.refusals = resume.progress.refusals;
  report.raw_csv = resume.raw_csv;
  return report;
}

}  // namespace

void Lanes::Lane::run(const std::stop_token& stop, const StartOrder& order,
                      const std::optional<UnfinishedRun>& left) {
  JigSessionOptions session = shared_.options.session;
  session.run.write = order.write;
  session.run.pose_time_out_s = shared_.options.pose_time_out_s;
  session.silence_s = shared_.options.silence_s;
  RunSaver saver(folder_, left ? *left : new_run(order, session.filter),
                 [this](const std::string& warning) {
                   const std::lock_guard lock(mutex_);
                   add_log("problem", warning);
                 });
  const UnfinishedRun& state = saver.state();
  session.filter = state.filter;
  const auto allowed = check_write(state).and_then([&] { return check_start(state.serial); });
  if (!allowed) {
    const Error& why = allowed.error();
    if (left && !order.last_run) {
      return end_interrupted(*left, "interrupted: " + why.brief(), why.code);
    }
    // Constants that wait, wait on: what the refusal is about may be put right.
    return end_unmeasured(state.serial, "refused", {why.what, why.hint}, why.brief());
  }
  if (order.last_run) {
    // For a program that goes on with it: the store has this run's samples, and their file is gone.
    static_cast<void>(folder_.append(left->resume.raw_csv));
  }
  // "Write now" is no second run: what its readings had to show, they had to show when they were
  // taken.
  session.retest = left && left->retest ? *left->retest : *allowed;
  saver.set_retest(session.retest);
  if (state.kind == kWriteKind) {
    session.notes.emplace_back(
        "written after the run: the readings that judge the constants are those of the run");
  }
  last_accepted_ = env_.clock.elapsed();
  {
    const std::lock_guard lock(mutex_);
    forget_unwritten();
    if (!run_) {
      run_.emplace();
    }
    run_->started = left && !order.last_run ? left->resume.started : env_.clock.now();
  }
  const auto report = run_jig(on_jig(), env_, session, run_hooks(stop, saver),
                              left ? std::optional(left->resume) : std::nullopt);
  if (stop.stop_requested()) {
    static_cast<void>(folder_.close());  // the next program continues it
    return;
  }
  if (unit_) {
    look_at_jig();  // before the next run can be asked for
  }
  if (!report) {
    return end_without_report(state.serial, report.error());
  }
  std::string who = state.operator_name;
  {
    const std::lock_guard lock(mutex_);
    who = both_names(who, operator_name_);
  }
  show_result(*report,
              {std::move(who), state.is_authenticated, state.station, session.retest.retest_of,
               state.kind, state.jig_id.value_or(shared_.options.jig_id)});
  const std::lock_guard lock(mutex_);
  if (report->usable() && !report->written && !report->write_begun && run_) {
    UnfinishedRun& last = unwritten_.emplace(state);
    last.resume = {run_->progress, report->started, report->as_found, {},
                   false,          report->stream,  report->raw_csv};
    unwritten_serial_ = state.serial;
  }
  result_["verdict_ms"] =
      std::chrono::duration<double, std::milli>(env_.clock.elapsed() - last_accepted_).count();
  if (report->six && report->usable()) {
    approximation_ = report->six->best().calibration;  // the preview shows calibrated readings
  }
  changed();
}

void Lanes::Lane::write_last(const std::stop_token& stop, const StartOrder& order) {
  UnfinishedRun left = *unwritten_;
  left.operator_name = both_names(left.operator_name, order.operator_name);
  left.is_authenticated = left.is_authenticated && order.is_authenticated;
  left.client = order.client;
  left.write = true;
  left.kind = kWriteKind;
  StartOrder writing = order;
  writing.write = true;
  {
    const std::lock_guard lock(mutex_);
    write_ = true;
    run_.emplace().progress = left.resume.progress;
  }
  run(stop, writing, left);
}

UnfinishedRun Lanes::Lane::new_run(const StartOrder& order, calib::FilterConfiguration filter) {
  UnfinishedRun run;
  run.device = device_;
  run.serial = identity_.serial;
  run.firmware = identity_.firmware;
  run.operator_name = order.operator_name;
  run.is_authenticated = order.is_authenticated;
  run.station = shared_.options.station;
  run.client = order.client;
  run.write = order.write;
  run.filter = filter;
  run.jig = unit_ ? on_jig().jig->name() : std::string();
  run.jig_id = shared_.options.jig_id;
  run.gravity_m_per_s2 = shared_.options.session.gravity.m_per_s2;
  return run;
}

// An error where `run` is to write constants of an earlier one ("write now") that are written no
// more, or the store does not answer: then they wait on. What is in the unit already is measured,
// whatever became of it.
Status Lanes::Lane::check_write(const UnfinishedRun& run) {
  if (!shared_.options.may_write || run.kind != kWriteKind || run.resume.written) {
    return {};
  }
  const auto never = [&]() -> Result<std::optional<Error>> {
    const std::lock_guard lock(shared_.store_mutex);
    return shared_.options.may_write({run.serial, run.constants_id});
  }();
  if (!never) {
    return fail(never.error());
  }
  if (!*never) {
    return {};
  }
  const std::lock_guard lock(mutex_);
  forget_unwritten();
  return fail(**never);
}

// An error where the station is locked, its jig is overdue or the unit failed too often: an engineer
// decides. Asked again when a run goes on: the program may have been away for days.
Result<RetestState> Lanes::Lane::check_start(const std::string& serial) {
  if (!shared_.options.may_start) {
    return RetestState{};
  }
  const std::lock_guard lock(shared_.store_mutex);
  return shared_.options.may_start(serial);
}

JigHooks Lanes::Lane::run_hooks(const std::stop_token& stop, RunSaver& saver) {
  JigHooks hooks;
  hooks.on_action = [this](const JigAction& action) { on_action(action); };
  hooks.samples = [this](const device::SampleBlock& block, const JigRun& machine) {
    const JigLive live = machine.live();
    {
      // The unit's own constants may be wrong by 25 degrees; those that the run has found are not.
      const calib::Calibration found = machine.approximation();
      const std::lock_guard lock(mutex_);
      approximation_ = found;
    }
    add_readings(block, &live);
  };
  hooks.raw = [&saver](std::string_view rows) { saver.add_rows(rows); };
  hooks.progress = [this, &saver](const JigReport& report, const JigRun& machine) {
    saver.save(report, machine);
    const std::lock_guard lock(mutex_);
    run_->progress = machine.progress();
    run_->open = machine.open_poses();
    changed();
  };
  hooks.write_begins = [&saver](const JigReport& report, const JigRun& machine) {
    return saver.save_now(report, machine);
  };
  hooks.next_command = [this] { return next_command(); };
  hooks.reopen = [this, &stop, &saver](const Error& error, const JigHooks::Look& look) {
    return wait_for_unit(stop, saver.state().serial, error.what, LaneState::running, look);
  };
  return hooks;
}

void Lanes::Lane::on_action(const JigAction& action) {
  const std::lock_guard lock(mutex_);
  switch (action.kind) {
    case JigAction::Kind::place:
      run_->wanted = action.pose;
      run_->prompt = action.text;
      waiting_since_ms_ = unix_ms(env_.clock.now());
      break;
    case JigAction::Kind::refused:
      run_->last_refusal = action.text;
      break;
    case JigAction::Kind::accepted:
      run_->last_refusal.clear();
      last_accepted_ = env_.clock.elapsed();
      break;
    case JigAction::Kind::write:
    case JigAction::Kind::finished:
      run_->wanted.reset();
      run_->prompt = action.text;
      break;
    case JigAction::Kind::dropped:
    case JigAction::Kind::fit:
      break;
  }
  add_log(kLogKinds.at(static_cast<std::size_t>(action.kind)), action.text);
}

// What is on the disk becomes an interrupted run, with its data.
void Lanes::Lane::end_without_report(const std::string& serial, const Error& error) {
  static_cast<void>(folder_.close());
  if (const auto saved = folder_.load(); saved && *saved) {
    end_interrupted(**saved, error.brief(), error.code);
  } else {
    end_unmeasured(serial, "inconclusive", {error.brief()}, error.brief());
  }
  if (error.code == ErrorCode::device_unavailable) {
    close_unit();
  }
}

void Lanes::Lane::end_unmeasured(const std::string& serial, const char* verdict,
                                 std::vector<std::string> reasons, std::string message) {
  const std::lock_guard lock(mutex_);
  run_.reset();
  set_done({{"kind", "jig"},
            {"serial", serial},
            {"verdict", verdict},
            {"reasons", std::move(reasons)},
            {"stored", false}},
           std::move(message));
}

void Lanes::Lane::show_result(const JigReport& report, const RunLabels& labels) {
  unstored_ = Unstored{report, labels};
  const std::lock_guard lock(mutex_);
  if (run_) {
    run_->wanted.reset();
    run_->open.clear();
    run_->progress.phase = JigPhase::finished;
  }
  live_ = {};
  set_done(json_of(report), "");
}

void Lanes::Lane::store_result(const std::stop_token& stop) {
  if (!unstored_) {
    return;
  }
  const auto stored = [&]() -> Result<RunInStore> {
    if (!unstored_->never_again.empty()) {
      return fail(ErrorCode::bad_data, unstored_->never_again);
    }
    const std::lock_guard lock(shared_.store_mutex);
    try {
      return shared_.store_run(unstored_->report, unstored_->labels);
    } catch (const std::exception& defect) {  // as in end_by_defect()
      unstored_->never_again = fmt::format(
          "a defect of the program ended the storing: {}; it is not known whether the store has "
          "the run",
          printable(defect.what()));
      return fail(ErrorCode::bad_data, unstored_->never_again);
    }
  }();
  if (!stored && stored.error().code == ErrorCode::bad_data) {
    if (unstored_->never_again.empty()) {
      unstored_->never_again = "not stored, and no store takes it: " + stored.error().brief();
    }
    if (!set_aside_result()) {
      pause(stop, kStoreRetry_s);
    }
    return;
  }
  const Status cleared = stored ? folder_.clear() : Status();
  {
    const std::lock_guard lock(mutex_);
    const bool is_shown = result_.is_object() && result_["serial"] == unstored_->report.serial;
    if (!stored) {
      is_unstored_ = true;
      const std::string problem = "not stored yet: " + stored.error().brief();
      if (is_shown) {
        result_["problem"] = problem;
      }
      add_log("problem", problem);
    } else {
      if (!cleared) {
        add_log("problem", cleared.error().brief());
      }
      if (!stored->said.empty()) {
        add_log("problem", stored->said);
      }
      if (is_shown) {
        result_["stored"] = !stored->is_kept_here;
        result_["kept_here"] = stored->is_kept_here;
        result_["run"] = stored->ids.run_id;
        result_["documents"] = stored->documents;
        result_["constants_id"] =
            stored->ids.constants_id ? Json(*stored->ids.constants_id) : Json(nullptr);
        result_.erase("problem");
      }
      if (unwritten_ && unwritten_->constants_id.empty()) {
        unwritten_->constants_id = stored->ids.constants_id.value_or("");
      }
      unstored_.reset();
      is_unstored_ = false;
      changed();
    }
  }
  if (!stored) {
    pause(stop, kStoreRetry_s);
  }
}

bool Lanes::Lane::set_aside_result() {
  const std::string& why = unstored_->never_again;
  const auto kept = folder_.set_aside_ended_run(
      unstored_->report.to_json().dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  const std::lock_guard lock(mutex_);
  const std::string problem =
      kept ? fmt::format("{}; it is kept in {}, its samples beside", why, *kept)
           : fmt::format("{}; it is not set aside yet: {}", why, kept.error().brief());
  if (result_.is_object() && result_["serial"] == unstored_->report.serial) {
    result_["problem"] = problem;
  }
  add_log("problem", problem);
  is_unstored_ = !kept;
  // Constants of which there is no record are not written, also where it was asked meanwhile.
  forget_unwritten();
  if (kept) {
    unstored_.reset();
    if (order_ && order_->start.last_run) {
      order_.reset();
      add_log("problem", "not started: there is no record of the run whose constants wait");
    }
  }
  return kept.has_value();
}

void Lanes::Lane::continue_run(const std::stop_token& stop, const UnfinishedRun& left) {
  const StartOrder order = {left.operator_name, left.is_authenticated, left.client, left.serial,
                            left.write};
  {
    const std::lock_guard lock(mutex_);
    run_.emplace().progress = left.resume.progress;
    run_->started = left.resume.started;
    identity_.firmware = left.firmware;
  }
  UnfinishedRun now = new_run(order, left.filter);
  now.serial = left.serial;
  now.protocol = left.protocol;
  if (const auto goes_on = run_goes_on(left, now); !goes_on) {
    return end_interrupted(left, "interrupted: " + goes_on.error().what, goes_on.error().code);
  }
  const auto unit = wait_to_continue(stop, order, "run", LaneState::running);
  if (stop.stop_requested()) {
    return;
  }
  if (!unit) {
    return end_interrupted(left, "interrupted: " + unit.error().what, unit.error().code);
  }
  run(stop, order, left);
}

void Lanes::Lane::end_interrupted(const UnfinishedRun& left, const std::string& reason,
                                  ErrorCode code) {
  JigReport report =
      interrupted_report(left, shared_.options.session, env_.clock.now(), reason, code);
  if (stop_requested()) {
    report.verdict = JigVerdict::stopped;
    report.codes = {"stopped"};
  }
  show_result(report, {left.operator_name,
                       left.is_authenticated,
                       left.station,
                       {},
                       left.kind,
                       left.jig_id.value_or(shared_.options.jig_id)});
}

}  // namespace sixpoint::station
