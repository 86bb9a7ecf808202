#include "station/run/jig_session.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "repair/triage/triage.h"
#include "station/run/jig_judgement.h"
#include "station/run/jig_watch.h"
#include "station/run/unit_stream.h"

namespace sixpoint::station {

namespace {

using calib::Calibration;
using calib::FilterConfiguration;

constexpr std::chrono::milliseconds kReadFor{250};
constexpr std::string_view kRawHeadline = "device_time_us,x_lsb,y_lsb,z_lsb,temperature_c\n";
constexpr int kWritable_mv = 3300;  // docs/protocol.md, code 7

double seconds(std::chrono::nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

// A returned unit of 2013-14: the firmware knows two configurations for it. Without a date, or with
// one that cannot be, it is taken for one.
bool has_two_filters(const std::string& serial,
                     const std::optional<device::CalibrationPage>& page) {
  const UtcTime first = repair::first_possible_calibration();
  const UtcTime calibrated = page ? std::max<UtcTime>(page->calibrated, first) : first;
  return repair::filter_of_constants({serial, {}, calibrated}) == FilterConfiguration::legacy;
}

class Session {
 public:
  Session(UnitOnJig on_jig, Env& env, const JigSessionOptions& options, const JigHooks& hooks)
      : unit_(on_jig.unit),
        jig_(on_jig.jig),
        env_(env),
        options_(options),
        hooks_(hooks),
        gravity_g_(options.gravity.g()),
        stream_(options.filter, options.run.rate_hz),
        watch_(options.jig_watch) {}

  Result<JigReport> run(const std::optional<JigResume>& resume);

 private:
  Status prepare(const std::optional<JigResume>& resume);
  // True where reopen() is to be asked for the unit, which was unplugged.
  bool may_come_back(const Error& error) const;
  Status reopen(const Error& error);
  Status come_back(JigRun& run, const Error& error);
  Status end_away(JigRun& run, const Error& error);
  Status look_while_away();
  Status obey(JigRun& run, OperatorCommand command);
  void keep_interrupted(const JigRun& run, const Error& error);
  void keep_rows(std::string_view rows);
  Status stream(JigRun& run);
  Status take_block(JigRun& run, const device::SampleBlock& block, double now_s);
  Status end_stream(const JigRun& run);
  Status handle(JigRun& run, const std::vector<JigAction>& actions);
  void keep_raw(const device::SampleBlock& block);
  Status write_constants(JigRun& run);
  Status back_in_write(JigRun& run, const Error& error);
  Status conclude(const JigRun& run);

  device::Unit* unit_;
  device::Jig* jig_;
  Env& env_;
  const JigSessionOptions& options_;
  const JigHooks& hooks_;
  double gravity_g_;
  JigReport report_;
  Calibration approximation_ = first_approximation(std::nullopt).calibration;
  bool ended_ = false;
  std::optional<Error> gone_;  // why the unit did not come back
  std::string last_text_;      // text of the machine's last action
  UnitStream stream_;
  JigWatch watch_;
  // While the unit is away: what the operator said, and what the jig said.
  std::vector<OperatorCommand> said_while_away_;
  std::optional<Error> jig_while_away_;
  bool jig_failed_ = false;
  // What the jig answered, which is passed on.
  template <class Answer>
  Answer of_jig(Answer answer) {
    jig_failed_ = jig_failed_ || !answer;
    return answer;
  }
};

Status Session::prepare(const std::optional<JigResume>& resume) {
  report_.started = resume ? resume->started : env_.clock.now();
  report_.serial = unit_->identity().serial;
  report_.firmware = unit_->identity().firmware;
  report_.jig = jig_->name();
  report_.filter = options_.filter;
  report_.protocol = options_.run.protocol;
  report_.gravity = options_.gravity;
  report_.limits = options_.limits;
  report_.reasons = options_.notes;
  const auto page = unit_->read_calibration();
  if (page) {
    report_.as_found = *page;
    const FirstApproximation first = first_approximation(page->constants);
    approximation_ = first.calibration;
    if (first.is_nominal) {
      report_.reasons.emplace_back(
          "as found, the unit held constants that no working sensor can have");
    }
  } else if (page.error().code == ErrorCode::bad_data) {
    report_.reasons.push_back("as found, the unit's constants were unreadable: " +
                              page.error().what);
  } else {
    return fail(page.error());
  }
  if (resume) {
    // As found is what the unit held when the run began; it may have been written since.
    const auto now = report_.as_found;
    report_.as_found = resume->as_found;
    if (resume->written && now && now->constants == resume->written->constants) {
      report_.as_left = now;
      report_.written = true;
    } else if (resume->write_begun || resume->written) {
      // Read just now: it is known again what the unit holds.
      report_.as_left = now;
      report_.write_begun = !now;
    }
    stream_ = UnitStream(options_.filter, options_.run.rate_hz, resume->stream);
  }
  if (options_.filter == FilterConfiguration::legacy &&
      has_two_filters(report_.serial, report_.as_found)) {
    return fail(ErrorCode::usage,
                "a unit calibrated before 2014-03-24 must be measured under the filter 'current'",
                report_.serial,
                "leave out --filter: constants of 'legacy' would make its affected files worse");
  }
  if (options_.run.write && unit_->identity().battery_mv < kWritable_mv) {
    return fail(ErrorCode::io,
                fmt::format("the unit's battery has {} mV; below {} mV it takes no constants",
                            unit_->identity().battery_mv, kWritable_mv),
                report_.serial, "charge the unit, or leave out --write");
  }
  return stream_.start(*unit_);
}

void Session::keep_rows(std::string_view rows) {
  report_.raw_csv += rows;
  if (hooks_.raw) {
    hooks_.raw(rows);
  }
}

void Session::keep_raw(const device::SampleBlock& block) {
  std::string rows;
  for (std::size_t i = 0; i < block.counts.size(); ++i) {
    const auto& counts = block.counts[i];
    fmt::format_to(
        std::back_inserter(rows), "{},{},{},{},{:.2f}\n",
        block.device_time_us + i * 1'000'000 / static_cast<std::uint64_t>(options_.run.rate_hz),
        counts[0], counts[1], counts[2], block.temperature_c);
  }
  keep_rows(rows);
}

bool Session::may_come_back(const Error& error) const {
  return error.code == ErrorCode::device_unavailable && hooks_.reopen;
}

// Waits for the unit of this run. Where it does not come back, there is no unit any more.
Status Session::reopen(const Error& error) {
  // Read now: the hook may close the unit.
  stream_.count(*unit_);
  do {
    const Result<UnitOnJig> again = hooks_.reopen(error, [this] { return look_while_away(); });
    if (!again) {
      unit_ = nullptr;
      jig_ = nullptr;
      return fail(again.error());
    }
    unit_ = again->unit;
    jig_ = again->jig;
  } while (unit_->identity().serial != report_.serial);
  return {};
}

// Waits for the unit and goes on with it. Ends the run when it does not come back.
Status Session::come_back(JigRun& run, const Error& error) {
  for (Status ready = fail(error); !ready;) {
    if (!may_come_back(ready.error())) {
      return ready;
    }
    if (const Status found = reopen(ready.error()); !found) {
      return end_away(run, found.error());
    }
    ready = stream_.start(*unit_);
  }
  SIXPOINT_CHECK(handle(run, run.on_unit_back(seconds(unit_->clock().elapsed()))));
  for (const OperatorCommand command : std::exchange(said_while_away_, {})) {
    SIXPOINT_CHECK(obey(run, command));
  }
  // After a power cut the jig does not know where the unit lies.
  return run.open_poses().empty()
             ? Status{}
             : of_jig(JigWatch::place(*jig_, run.open_poses().front(), run.phase()));
}

// The unit did not come back, or the wait was ended.
Status Session::end_away(JigRun& run, const Error& error) {
  if (jig_while_away_) {
    return fail(*jig_while_away_);
  }
  if (error.code != ErrorCode::device_unavailable) {
    return fail(error);  // the driver ends the run
  }
  gone_ = error;
  // A driver that saw the operator's stop itself leaves it in the queue, behind other commands.
  while (const auto command = hooks_.next_command ? hooks_.next_command() : std::nullopt) {
    said_while_away_.push_back(*command);
  }
  const bool stopped =
      std::ranges::find(said_while_away_, OperatorCommand::stop) != said_while_away_.end();
  return handle(run, stopped ? run.on_operator(OperatorCommand::stop) : run.on_unit_gone());
}

// The motor stops before all else.
Status Session::obey(JigRun& run, OperatorCommand command) {
  if (command == OperatorCommand::stop && jig_->turns_by_itself()) {
    // One that does not answer now is held all the same, and the run ends.
    static_cast<void>(jig_->stop());
  }
  return handle(run, run.on_operator(command));
}

Status Session::look_while_away() {
  while (const auto command = hooks_.next_command ? hooks_.next_command() : std::nullopt) {
    said_while_away_.push_back(*command);
    if (*command == OperatorCommand::stop) {
      if (jig_->turns_by_itself()) {
        static_cast<void>(jig_->stop());
      }
      return fail(ErrorCode::device_unavailable, "stopped by the operator");
    }
  }
  if (jig_->turns_by_itself()) {
    if (const Status free = of_jig(device::check_jig(*jig_)); !free) {
      jig_while_away_ = free.error();
      static_cast<void>(jig_->stop());
      return fail(free.error());
    }
  }
  return {};
}

// The report of what was measured until the error; no verdict on the unit.
void Session::keep_interrupted(const JigRun& run, const Error& error) {
  report_.ended = env_.clock.now();
  report_.refusals = run.refusals();
  report_.faces = run.faces();
  report_.half_turn = run.half_turn();
  report_.stream = stream_.statistics(unit_);
  report_.settle_as_left();
  report_.verdict = JigVerdict::inconclusive;
  report_.codes = {jig_failed_ ? "interrupted" : interruption(error.code)};
  report_.reasons.push_back(error.what);
  report_.ended_by = error;
}

Status Session::take_block(JigRun& run, const device::SampleBlock& block, double now_s) {
  if (block.filter != options_.filter) {
    return fail(ErrorCode::io,
                fmt::format("the unit changed its filter to '{}' in mid-run",
                            calib::to_string(block.filter)),
                report_.serial, "begin the run again");
  }
  if (stream_.lost_since_asked(*unit_)) {
    SIXPOINT_CHECK(handle(run, run.on_loss()));
  }
  keep_raw(block);
  for (const device::RawCounts& counts : block.counts) {
    SIXPOINT_CHECK(handle(run, run.on_sample({now_s, counts, block.temperature_c})));
  }
  if (hooks_.samples) {
    hooks_.samples(block, run);
  }
  return {};
}

Status Session::stream(JigRun& run) {
  SIXPOINT_CHECK(handle(run, run.start(seconds(unit_->clock().elapsed()))));
  double last_block_s = seconds(unit_->clock().elapsed());
  while (run.phase() != JigPhase::finished && !ended_) {
    auto block = unit_->next_samples(kReadFor);
    const double now_s = seconds(unit_->clock().elapsed());
    if (block && !*block && now_s - last_block_s > options_.silence_s) {
      block = fail(ErrorCode::device_unavailable, "the unit stopped sending samples",
                   unit_->address(), "plug the unit in again and begin the run anew");
    }
    if (!block) {
      if (!may_come_back(block.error())) {
        run.on_unit_gone();
        return fail(block.error());
      }
      SIXPOINT_CHECK(come_back(run, block.error()));
      if (unit_ == nullptr) {
        break;
      }
      last_block_s = seconds(unit_->clock().elapsed());
      continue;
    }
    if (*block) {
      last_block_s = now_s;
      SIXPOINT_CHECK(take_block(run, **block, now_s));
    }
    while (const auto command = hooks_.next_command ? hooks_.next_command() : std::nullopt) {
      SIXPOINT_CHECK(obey(run, *command));
    }
    if (run.phase() !=
        JigPhase::finished) {  // else the operator's stop would be a fault of the jig
      SIXPOINT_ASSIGN(const std::optional<Pose> stands, of_jig(watch_.ask(*jig_, now_s)));
      run.set_jig_pose(stands);
    }
    SIXPOINT_CHECK(handle(run, run.on_time(now_s)));
  }
  return unit_ == nullptr ? Status{} : end_stream(run);
}

Status Session::end_stream(const JigRun& run) {
  const Status stopped = stream_.stop(*unit_);
  // The readings are complete: a unit that is unplugged now is no error.
  const bool may_fail = run.outcome() == JigOutcome::unit_gone ||
                        run.outcome() == JigOutcome::stopped ||
                        (!stopped && stopped.error().code == ErrorCode::device_unavailable);
  return may_fail ? Status{} : stopped;
}

Status Session::handle(JigRun& run, const std::vector<JigAction>& actions) {
  // Where the machine asks for two poses at once, the last one counts.
  std::optional<Pose> wanted;
  for (const JigAction& action : actions) {
    if (hooks_.on_action) {
      hooks_.on_action(action);
    }
    switch (action.kind) {
      case JigAction::Kind::place:
        wanted = action.pose;
        break;
      case JigAction::Kind::fit: {
        SIXPOINT_ASSIGN(const calib::SixPoseReport first,
                        solve_faces(run.faces(), {}, options_.gravity, options_.limits));
        run.set_approximation(first.per_axis.calibration);
        break;
      }
      case JigAction::Kind::write: {
        report_.stream = stream_.statistics(unit_);  // judged with the rest
        SIXPOINT_ASSIGN(const bool verified, judge_readings(report_, run));
        if (!verified) {
          ended_ = true;  // constants that failed are not written
          return {};
        }
        return write_constants(run);
      }
      case JigAction::Kind::accepted:
      case JigAction::Kind::refused:
        if (jig_ != nullptr) {
          SIXPOINT_CHECK(of_jig(watch_.compare(*jig_, action)));
        }
        break;
      case JigAction::Kind::dropped:
        break;
      case JigAction::Kind::finished:
        last_text_ = action.text;
        break;
    }
  }
  if (hooks_.progress && !actions.empty()) {
    report_.stream = stream_.statistics(unit_);
    hooks_.progress(report_, run);
  }
  return wanted ? of_jig(JigWatch::place(*jig_, *wanted, run.phase())) : Status{};
}

Status Session::write_constants(JigRun& run) {
  static_cast<void>(stream_.stop(*unit_));  // an unplugged unit gives an error below
  // Today's date: the firmware concludes from it that the constants belong to `current`.
  const device::CalibrationPage page{
      report_.six->best().stored, std::chrono::floor<std::chrono::seconds>(unit_->clock().now())};
  report_.write_begun = true;
  if (hooks_.write_begins) {
    report_.stream = stream_.statistics(unit_);
    if (const Status noted = hooks_.write_begins(report_, run); !noted) {
      report_.write_begun = false;
      report_.reasons.push_back("not written: that a write begins could not be noted down: " +
                                noted.error().brief());
      report_.ended_by = noted.error();
      ended_ = true;
      return {};
    }
  }
  Status written = unit_->write_calibration(page);
  // The unit holds the old page or the new one, whole: the write is repeated, once.
  if (!written) {
    SIXPOINT_CHECK(back_in_write(run, written.error()));
    if (run.phase() == JigPhase::finished) {
      return {};
    }
    written = unit_->write_calibration(page);
  }
  auto holds = unit_->read_calibration();
  if (!holds) {
    SIXPOINT_CHECK(back_in_write(run, holds.error()));
    if (run.phase() == JigPhase::finished) {
      return {};
    }
    holds = unit_->read_calibration();
  }
  if (!written && !holds && holds.error().code == ErrorCode::bad_data && !report_.as_found) {
    // Unreadable as found, and as it was: the unit refused the write.
    ended_ = true;
    report_.write_begun = false;
    report_.reasons.push_back(written.error().what);
    return {};
  }
  SIXPOINT_ASSIGN(report_.as_left, holds);
  report_.write_begun = false;
  if (!written && *holds != page) {
    ended_ = true;
    report_.reasons.push_back(written.error().what);
    return {};
  }
  report_.written = true;
  SIXPOINT_ASSIGN(const Calibration calibration, calib::calibration_from(holds->constants));
  run.set_approximation(calibration);
  if (const Status ready = stream_.start(*unit_); !ready) {
    SIXPOINT_CHECK(come_back(run, ready.error()));
    if (run.phase() == JigPhase::finished) {
      return {};
    }
  }
  return handle(run, run.on_written(seconds(unit_->clock().elapsed())));
}

// After an error in a write: waits for the unit where it was unplugged. It does not stream then.
Status Session::back_in_write(JigRun& run, const Error& error) {
  Status ready = fail(error);
  while (!ready && may_come_back(ready.error())) {
    SIXPOINT_CHECK(come_back(run, ready.error()));
    if (run.phase() == JigPhase::finished) {
      return {};
    }
    ready = stream_.stop(*unit_);
  }
  return !ready && ready.error().code == ErrorCode::device_unavailable ? ready : Status{};
}

Status Session::conclude(const JigRun& run) {
  report_.ended = env_.clock.now();
  report_.refusals = run.refusals();
  report_.stream = stream_.statistics(unit_);
  SIXPOINT_CHECK(judge_readings(report_, run));
  report_.settle_as_left();
  if (report_.as_found) {
    const auto found = calib::calibration_from(report_.as_found->constants);
    if (found && !report_.faces.empty()) {
      report_.as_found_residual_mg = judge(report_.faces, *found, gravity_g_).worst_mg;
    }
  }
  if (report_.stream.clock_jumps > 0) {
    report_.reasons.push_back(
        fmt::format("the unit's clock jumped by {:+.3f} s in mid-run ({} times); constants do not "
                    "depend on it, recordings of this unit may",
                    report_.stream.clock_jumped_s, report_.stream.clock_jumps));
  }
  conclude_report(report_, run, {options_.run.write, options_.retest, last_text_, gone_});
  return {};
}

Result<JigReport> Session::run(const std::optional<JigResume>& resume) {
  Status ready = prepare(resume);
  while (!ready && may_come_back(ready.error())) {
    SIXPOINT_CHECK(reopen(ready.error()));
    ready = prepare(resume);
  }
  SIXPOINT_CHECK(std::move(ready));
  said_while_away_.clear();  // said before the run asked for anything
  JigRun machine(options_.run, approximation_);
  if (resume) {
    JigProgress progress = resume->progress;
    if (progress.phase == JigPhase::rechecking && !report_.written) {
      progress.phase = JigPhase::writing;  // the unit holds another page: write again
      progress.recheck.clear();
    }
    machine.resume(progress);
    report_.raw_csv = resume->raw_csv;
  } else {
    keep_rows(kRawHeadline);
  }
  const Status streamed = stream(machine);
  if (!streamed) {
    if (jig_ != nullptr) {
      static_cast<void>(jig_->stop());
    }
    if (!options_.keep_interrupted) {
      return fail(streamed.error());
    }
    keep_interrupted(machine, streamed.error());
    return std::move(report_);
  }
  SIXPOINT_CHECK(conclude(machine));
  return std::move(report_);
}

}  // namespace

Status check_protocol(JigProtocol protocol, const device::Jig& jig) {
  if (protocol == JigProtocol::production_plus && !jig.can_half_turn()) {
    return fail(
        ErrorCode::usage,
        "production+ lays three faces turned about the vertical, and this jig cannot do that",
        jig.name(), "leave out --protocol, or turn the unit by hand (--jig manual)");
  }
  return {};
}

std::string interruption(ErrorCode code) {
  return code == ErrorCode::device_unavailable ? "unit_gone" : "interrupted";
}

Result<JigReport> run_jig(UnitOnJig on_jig, Env& env, const JigSessionOptions& options,
                          const JigHooks& hooks, const std::optional<JigResume>& resume) {
  if (options.run.write && options.filter != FilterConfiguration::current) {
    return fail(ErrorCode::usage, "only constants of the filter 'current' are written into units",
                {}, "leave out --write or --filter");
  }
  SIXPOINT_CHECK(check_protocol(options.run.protocol, *on_jig.jig));
  return Session(on_jig, env, options, hooks).run(resume);
}

}  // namespace sixpoint::station
