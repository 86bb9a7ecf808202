#include "station/jig_session.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"

namespace sixpoint::station {

namespace {

using calib::Calibration;
using calib::FilterConfiguration;

constexpr std::chrono::milliseconds kReadFor{250};
constexpr std::string_view kRawHeadline = "device_time_us,x_lsb,y_lsb,z_lsb,temperature_c\n";
constexpr int kWritable_mv = 3300;  // docs/protocol.md, code 7
// A unit without a readable page: the middle of what ADXL362 units hold. Enough to tell faces.

double seconds(std::chrono::nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

// A returned unit of 2013-14: the firmware knows two configurations for it.
bool has_two_filters(const std::string& serial,
                     const std::optional<device::CalibrationPage>& page) {
  constexpr std::int64_t kFilterChange_unix_s = 1'395'619'200;  // 2014-03-24
  return serial.starts_with("MOS") &&
         (!page || page->calibrated < from_unix_seconds(kFilterChange_unix_s));
}

// A program that was killed leaves its unit streaming, and such a unit takes no other filter.
Status choose_filter(device::Unit& unit, calib::FilterConfiguration filter) {
  Status chosen = unit.set_filter(filter);
  if (chosen || chosen.error().code != ErrorCode::io) {
    return chosen;
  }
  SIXPOINT_CHECK(unit.stop_stream());
  return unit.set_filter(filter);
}

class Session {
 public:
  Session(UnitOnJig on_jig, Env& env, const JigSessionOptions& options, const JigHooks& hooks)
      : unit_(on_jig.unit),
        jig_(on_jig.jig),
        env_(env),
        options_(options),
        hooks_(hooks),
        gravity_g_(options.gravity.g()) {}

  Result<JigReport> run(const std::optional<JigResume>& resume);

 private:
  Status prepare(const std::optional<JigResume>& resume);
  Status come_back(JigRun& run, const Error& error);
  Status ask_jig(double now_s);
  // What the jig says about a placement that the unit has judged.
  Status compare_with_jig(const JigAction& action);
  void say_what_is_left();
  void keep_interrupted(const JigRun& run, const Error& error);
  void keep_rows(std::string_view rows);
  Status stream(JigRun& run);
  Status handle(JigRun& run, const std::vector<JigAction>& actions);
  void keep_raw(const device::SampleBlock& block);
  Result<calib::SixPoseReport> solve(const std::vector<PoseReading>& faces,
                                     const std::vector<PoseReading>& held_out) const;
  Result<bool> judge_verification(const JigRun& run);
  Status write_constants(JigRun& run);
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
  bool write_unknown_ = false;  // a write was begun, and the page not read since
  std::optional<Error> gone_;   // why the unit was given up
  std::string last_words_;      // what the machine said when it ended
  std::optional<double> jig_asked_s_;
  int jig_disagreements_ = 0;
  std::uint64_t clock_jumps_before_ = 0;
  double clock_jumped_before_s_ = 0;
  std::uint64_t lost_before_ = 0;
};

Status Session::prepare(const std::optional<JigResume>& resume) {
  report_.started = resume ? resume->started : env_.clock.now();
  report_.serial = unit_->identity().serial;
  report_.firmware = unit_->identity().firmware;
  report_.jig = jig_->name();
  report_.filter = options_.filter;
  report_.gravity = options_.gravity;
  report_.limits = options_.limits;
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
    // Tilt and faces are judged by what the unit held when the run began; the reading above is what
    // it holds now.
    const auto now = report_.as_found;
    report_.as_found = resume->as_found;
    if (resume->written && now && now->constants == resume->written->constants) {
      report_.as_left = now;
      report_.written = true;
    }
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
  return choose_filter(*unit_, options_.filter);
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

// Waits for the unit and goes on with it. Ends the run when it does not come back.
Status Session::come_back(JigRun& run, const Error& error) {
  // reopen() may let go of the unit.
  const device::StreamStatistics until_now = unit_->stream_statistics();
  lost_before_ += until_now.lost_samples;
  clock_jumps_before_ += until_now.clock_jumps;
  clock_jumped_before_s_ += until_now.clock_jumped_s;
  for (;;) {
    const Result<UnitOnJig> again = hooks_.reopen(error);
    if (!again) {
      report_.stream = until_now;
      unit_ = nullptr;  // whoever kept them let go of them
      jig_ = nullptr;
    }
    if (!again && again.error().code != ErrorCode::device_unavailable) {
      return fail(again.error());  // whoever drives the run ends it himself
    }
    if (!again) {
      gone_ = again.error();
      const auto word = hooks_.words ? hooks_.words() : std::nullopt;
      return handle(run, word == OperatorWord::stop ? run.on_operator(*word) : run.on_unit_gone());
    }
    unit_ = again->unit;
    jig_ = again->jig;
    if (unit_->identity().serial != report_.serial) {
      continue;
    }
    Status ready = choose_filter(*unit_, options_.filter);
    if (ready) {
      ready = unit_->start_stream(options_.run.rate_hz);
    }
    if (ready) {
      break;
    }
    if (ready.error().code != ErrorCode::device_unavailable) {
      return ready;
    }
  }
  SIXPOINT_CHECK(handle(run, run.on_unit_back(seconds(unit_->clock().elapsed()))));
  // A jig by itself does not know where the unit lies after a power cut.
  return run.open_poses().empty() ? Status{} : jig_->go_to(run.open_poses().front());
}

// A jig that is in trouble ends the run: nothing that it turns from here on means anything.
Status Session::ask_jig(double now_s) {
  if (jig_ == nullptr || !jig_->turns_by_itself() ||
      (jig_asked_s_ && now_s - *jig_asked_s_ < options_.jig_poll_s)) {
    return {};
  }
  jig_asked_s_ = now_s;
  SIXPOINT_ASSIGN(const device::JigReport jig, jig_->report());
  if (!jig.fault.empty()) {
    return fail(ErrorCode::device_unavailable,
                fmt::format("the jig stopped: {}", printable(jig.fault, 120)), jig_->name(),
                "see to the jig, then begin the run anew");
  }
  return {};
}

Status Session::compare_with_jig(const JigAction& action) {
  if (jig_ == nullptr || !jig_->turns_by_itself()) {
    return {};
  }
  const bool tilted = action.kind == JigAction::Kind::refused && action.text.starts_with("tilted");
  if (action.kind != JigAction::Kind::accepted && !tilted) {
    return {};
  }
  SIXPOINT_ASSIGN(const device::JigReport jig, jig_->report());
  if (!jig.pose) {
    return {};  // it does not claim to know
  }
  if (*jig.pose != action.pose) {
    return fail(ErrorCode::bad_data,
                fmt::format("the jig says it stands at {} and the unit reads {}",
                            device::to_string(*jig.pose), device::to_string(action.pose)),
                jig_->name(), "look how the unit is seated, and whether the jig turns truly");
  }
  jig_disagreements_ = tilted ? jig_disagreements_ + 1 : 0;
  if (jig_disagreements_ >= options_.jig_disagreements) {
    return fail(ErrorCode::bad_data,
                fmt::format("the jig says it stands at {} to {:.2g} degrees, and the unit was {} "
                            "time after time",
                            device::to_string(*jig.pose), jig.angle_uncertainty_deg, action.text),
                jig_->name(), "look how the unit is seated, and whether the jig turns truly");
  }
  return {};
}

void Session::say_what_is_left() {
  if (write_unknown_) {
    report_.as_left.reset();
    report_.reasons.emplace_back(
        "the unit went away while its constants were written: it holds the old ones or the new "
        "ones, whole; measure it again to know which");
  } else if (!report_.as_left) {
    report_.as_left = report_.as_found;
  }
}

// What was measured until the error; nothing of it is judged.
void Session::keep_interrupted(const JigRun& run, const Error& error) {
  report_.ended = env_.clock.now();
  report_.refusals = run.refusals();
  report_.faces = run.faces();
  if (unit_ != nullptr) {
    report_.stream = unit_->stream_statistics();
  }
  say_what_is_left();
  report_.verdict = JigVerdict::inconclusive;
  report_.codes = {error.code == ErrorCode::device_unavailable ? "unit_gone" : "interrupted"};
  report_.reasons.push_back(error.what);
  report_.ended_by = error;
}

Status Session::stream(JigRun& run) {
  SIXPOINT_CHECK(unit_->start_stream(options_.run.rate_hz));
  SIXPOINT_CHECK(handle(run, run.start(seconds(unit_->clock().elapsed()))));
  double heard_s = seconds(unit_->clock().elapsed());
  std::uint64_t lost = 0;
  std::uint64_t clock_jumps = 0;
  while (run.phase() != JigPhase::finished && !ended_) {
    auto block = unit_->next_samples(kReadFor);
    const double now_s = seconds(unit_->clock().elapsed());
    if (block && !*block && now_s - heard_s > options_.silence_s) {
      block = fail(ErrorCode::device_unavailable, "the unit stopped sending samples",
                   unit_->address(), "plug the unit in again and begin the run anew");
    }
    if (!block) {
      if (block.error().code != ErrorCode::device_unavailable || !hooks_.reopen) {
        run.on_unit_gone();
        return fail(block.error());
      }
      SIXPOINT_CHECK(come_back(run, block.error()));
      if (unit_ == nullptr) {
        break;
      }
      heard_s = seconds(unit_->clock().elapsed());
      lost = 0;
      continue;
    }
    if (*block) {
      heard_s = now_s;
      if ((*block)->filter != options_.filter) {
        return fail(ErrorCode::io,
                    fmt::format("the unit changed its filter to '{}' in mid-run",
                                calib::to_string((*block)->filter)),
                    report_.serial, "begin the run anew");
      }
      lost = std::min(lost, unit_->stream_statistics().lost_samples);  // a new stream counts anew
      if (unit_->stream_statistics().lost_samples > lost) {
        lost = unit_->stream_statistics().lost_samples;
        SIXPOINT_CHECK(handle(run, run.on_loss()));
      }
      clock_jumps = std::min(clock_jumps, unit_->stream_statistics().clock_jumps);
      if (unit_->stream_statistics().clock_jumps > clock_jumps) {
        clock_jumps = unit_->stream_statistics().clock_jumps;
        SIXPOINT_CHECK(handle(run, run.on_loss()));  // no reading goes across it
      }
      keep_raw(**block);
      for (const device::RawCounts& counts : (*block)->counts) {
        SIXPOINT_CHECK(handle(run, run.on_sample({now_s, counts, (*block)->temperature_c})));
      }
      if (hooks_.samples) {
        hooks_.samples(**block, run);
      }
    }
    while (const auto word = hooks_.words ? hooks_.words() : std::nullopt) {
      SIXPOINT_CHECK(handle(run, run.on_operator(*word)));
    }
    SIXPOINT_CHECK(ask_jig(now_s));
    SIXPOINT_CHECK(handle(run, run.on_time(now_s)));
  }
  if (unit_ == nullptr) {
    return {};
  }
  report_.stream = unit_->stream_statistics();
  report_.stream.lost_samples += lost_before_;
  report_.stream.clock_jumps += clock_jumps_before_;
  report_.stream.clock_jumped_s += clock_jumped_before_s_;
  if (run.outcome() == JigOutcome::unit_gone || run.outcome() == JigOutcome::stopped) {
    static_cast<void>(unit_->stop_stream());  // it may be gone
    return {};
  }
  const Status stopped = unit_->stop_stream();
  // The readings are taken: a unit that is pulled out at once does no harm.
  return stopped || stopped.error().code == ErrorCode::device_unavailable ? Status{} : stopped;
}

Status Session::handle(JigRun& run, const std::vector<JigAction>& actions) {
  // A machine that asks twice at once means the last.
  std::optional<Pose> place;
  for (const JigAction& action : actions) {
    if (hooks_.tell) {
      hooks_.tell(action);
    }
    switch (action.kind) {
      case JigAction::Kind::place:
        place = action.pose;
        break;
      case JigAction::Kind::fit: {
        SIXPOINT_ASSIGN(const calib::SixPoseReport first, solve(run.faces(), {}));
        run.set_approximation(first.pair.calibration);
        break;
      }
      case JigAction::Kind::write: {
        SIXPOINT_ASSIGN(const bool verified, judge_verification(run));
        if (!verified) {
          ended_ = true;  // constants that failed are not written
          return {};
        }
        return write_constants(run);
      }
      case JigAction::Kind::accepted:
      case JigAction::Kind::refused:
        SIXPOINT_CHECK(compare_with_jig(action));
        break;
      case JigAction::Kind::dropped:
        break;
      case JigAction::Kind::finished:
        last_words_ = action.text;
        break;
    }
  }
  if (hooks_.progress && !actions.empty()) {
    hooks_.progress(report_, run);
  }
  return place ? jig_->go_to(*place) : Status{};
}

Result<calib::SixPoseReport> Session::solve(const std::vector<PoseReading>& faces,
                                            const std::vector<PoseReading>& held_out) const {
  const auto readings = [](const std::vector<PoseReading>& from) {
    std::vector<calib::PoseReading> to;
    to.reserve(from.size());
    for (const PoseReading& reading : from) {
      to.push_back({device::direction_of(reading.pose), reading.mean_lsb, reading.sd_lsb,
                    reading.samples, reading.temperature_c});
    }
    return to;
  };
  calib::SixPoseOptions options;
  options.gravity = options_.gravity;
  // Ranges and residuals are judged by the limits, with their guard bands; the solver only says
  // whether the readings contradict each other.
  options.gain_range = HUGE_VAL;
  options.zero_range_g = HUGE_VAL;
  options.held_out_mg = HUGE_VAL;
  options.most_sd_mg = std::max(options.most_sd_mg, 2 * *options_.limits.of("noise_mg").high);
  options.most_tilt_deg = std::max(options.most_tilt_deg, 2 * *options_.limits.of("tilt_deg").high);
  return calib::solve_six_poses(readings(faces), readings(held_out), options);
}

// Solves, chooses by the readings that no solution has seen, and says whether they may be used.
Result<bool> Session::judge_verification(const JigRun& run) {
  report_.faces = run.faces();
  if (report_.faces.size() < device::kPoses.size()) {
    return false;
  }
  SIXPOINT_ASSIGN(report_.six, solve(run.faces(), run.verification()));
  const calib::SixPoseSolution& best = report_.six->best();
  report_.method = fmt::format("six_pose_{}", calib::to_string(report_.six->chosen));
  report_.verification = judge(run.verification(), best.calibration, gravity_g_);
  if (const auto rounded = calib::calibration_from(best.stored)) {
    report_.rounded_residual_mg = judge(run.verification(), *rounded, gravity_g_).worst_mg;
  }
  for (PoseReading& face : report_.faces) {
    for (const calib::PoseResidual& residual : report_.six->poses) {
      if (!residual.held_out && residual.side == device::to_string(face.pose)) {
        face.tilt_deg = residual.tilt_deg;
      }
    }
  }
  const double left_mg = report_.verification.rms_mg;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    report_.combined.sensitivity_relative[axis] =
        std::hypot(best.uncertainty.sensitivity_relative[axis], left_mg / kMgPerG);
    report_.combined.zero_mg[axis] = std::hypot(best.uncertainty.zero_mg[axis], left_mg);
  }
  return report_.six->verified &&
         judge_quantities(measured_quantities(report_), options_.limits).usable();
}

Status Session::write_constants(JigRun& run) {
  static_cast<void>(unit_->stop_stream());  // a unit that is gone says so below
  // The date is today's: from it the firmware concludes the filter, and these constants belong to
  // `current`.
  const device::CalibrationPage page{
      report_.six->best().stored, std::chrono::floor<std::chrono::seconds>(unit_->clock().now())};
  write_unknown_ = true;
  Status written_status = unit_->write_calibration(page);
  // Whatever came between, the unit holds the old page or the new one: the whole is repeated, once.
  if (!written_status) {
    if (written_status.error().code == ErrorCode::device_unavailable && hooks_.reopen) {
      SIXPOINT_CHECK(come_back(run, written_status.error()));
      if (run.phase() == JigPhase::finished) {
        return {};
      }
      SIXPOINT_CHECK(unit_->stop_stream());
    }
    if (written_status.error().code != ErrorCode::device_unavailable || hooks_.reopen) {
      written_status = unit_->write_calibration(page);
    }
  }
  SIXPOINT_ASSIGN(report_.as_left, unit_->read_calibration());
  write_unknown_ = false;
  if (!written_status) {
    ended_ = true;
    report_.reasons.push_back(written_status.error().what);
    return {};
  }
  report_.written = true;
  SIXPOINT_ASSIGN(const Calibration written, calib::calibration_from(report_.as_left->constants));
  run.set_approximation(written);
  SIXPOINT_CHECK(choose_filter(*unit_, options_.filter));
  SIXPOINT_CHECK(unit_->start_stream(options_.run.rate_hz));
  return handle(run, run.on_written(seconds(unit_->clock().elapsed())));
}

Status Session::conclude(const JigRun& run) {
  report_.ended = env_.clock.now();
  report_.refusals = run.refusals();
  SIXPOINT_CHECK(judge_verification(run));
  say_what_is_left();
  if (report_.as_found) {
    if (const auto found = calib::calibration_from(report_.as_found->constants)) {
      report_.as_found_residual_mg = judge(report_.faces, *found, gravity_g_).worst_mg;
    }
  }
  if (report_.stream.clock_jumps > 0) {
    report_.reasons.push_back(
        fmt::format("the unit's clock jumped by {:+.3f} s in mid-run ({} times); constants do not "
                    "depend on it, recordings of this unit may",
                    report_.stream.clock_jumped_s, report_.stream.clock_jumps));
  }
  switch (run.outcome()) {
    case JigOutcome::sensor_stuck:
      report_.verdict = JigVerdict::fail;
      report_.codes = {"sensor_stuck"};
      report_.reasons.push_back(last_words_);
      return {};
    case JigOutcome::stopped:
      report_.verdict = JigVerdict::stopped;
      report_.codes = {"stopped"};
      report_.reasons.push_back("stopped by the operator");
      return {};
    case JigOutcome::timed_out:
    case JigOutcome::too_many_refusals:
    case JigOutcome::unit_gone:
      report_.verdict = JigVerdict::inconclusive;
      if (run.outcome() == JigOutcome::unit_gone) {
        report_.ended_by = gone_;
      }
      report_.codes = {run.outcome() == JigOutcome::timed_out           ? "time_out"
                       : run.outcome() == JigOutcome::too_many_refusals ? "too_many_refusals"
                                                                        : "unit_gone"};
      report_.reasons.push_back(
          run.outcome() == JigOutcome::timed_out
              ? "no pose was accepted in time; is the unit on the jig, and does the jig turn it?"
          : run.outcome() == JigOutcome::unit_gone
              ? fmt::format("the unit went away in mid-run and did not come back ({})",
                            gone_ ? gone_->what : std::string())
              : "too many placements were refused; look at jig, seat and cable");
      if (run.outcome() == JigOutcome::timed_out && report_.stream.lost_samples > 0) {
        report_.reasons.push_back(
            fmt::format("{} samples were lost or damaged on the way, and every reading begins anew "
                        "then: look at the cable",
                        report_.stream.lost_samples));
      }
      return {};
    case JigOutcome::running:
    case JigOutcome::complete:
      break;
  }
  if (report_.written) {
    const auto left = calib::calibration_from(report_.as_left->constants);
    report_.recheck = judge(run.recheck(), *left, gravity_g_);
  }
  Verdict judged = judge_quantities(measured_quantities(report_), options_.limits);
  const auto worse = [&](JigVerdict verdict, const char* code) {
    judged.verdict = verdict;
    judged.codes.emplace_back(code);
  };
  if (!report_.six || !report_.six->missing_directions.empty()) {
    worse(JigVerdict::inconclusive, "missing_pose");
  } else if (!report_.six->verified) {
    worse(JigVerdict::fail, "not_verified");
    judged.reasons.insert(judged.reasons.end(), report_.six->reasons.begin(),
                          report_.six->reasons.end());
  }
  if (report_.written && report_.as_left->constants != report_.six->best().stored) {
    worse(JigVerdict::fail, "read_back_differs");
    judged.reasons.emplace_back("the unit does not hold what was written");
  } else if (!report_.written && options_.run.write && judged.usable()) {
    worse(JigVerdict::fail, "write_refused");
    judged.reasons.emplace_back("the constants were not written into the unit");
  }
  apply_retest(judged, options_.retest);
  report_.verdict = judged.verdict;
  report_.codes = std::move(judged.codes);
  report_.quantities = std::move(judged.quantities);
  report_.reasons.insert(report_.reasons.end(), judged.reasons.begin(), judged.reasons.end());
  return {};
}

Result<JigReport> Session::run(const std::optional<JigResume>& resume) {
  SIXPOINT_CHECK(prepare(resume));
  JigRun machine(options_.run, approximation_);
  if (resume) {
    JigProgress progress = resume->progress;
    if (progress.phase == JigPhase::rechecking && !report_.written) {
      progress.phase = JigPhase::writing;  // the unit holds another page: written anew
      progress.recheck.clear();
    }
    machine.resume(progress);
    report_.raw_csv = resume->raw_csv;
  } else {
    keep_rows(kRawHeadline);
  }
  const Status streamed = stream(machine);
  if (!streamed) {
    // Whatever happened, leave the jig at rest.
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

nlohmann::ordered_json json_of(const PoseReading& reading) {
  nlohmann::ordered_json json;
  json["pose"] = device::to_string(reading.pose);
  json["mean_lsb"] = reading.mean_lsb;
  json["sd_lsb"] = reading.sd_lsb;
  json["samples"] = reading.samples;
  json["temperature_c"] = reading.temperature_c;
  json["tilt_deg"] = reading.tilt_deg;
  json["from"] = reading.from ? nlohmann::ordered_json(device::to_string(*reading.from))
                              : nlohmann::ordered_json(nullptr);
  return json;
}

PoseReading parse_reading(const nlohmann::ordered_json& json) {
  PoseReading reading;
  reading.pose = device::parse_pose(json.at("pose").get<std::string>()).value();
  reading.mean_lsb = json.at("mean_lsb").get<PerAxis<double>>();
  reading.sd_lsb = json.at("sd_lsb").get<PerAxis<double>>();
  reading.samples = json.at("samples").get<int>();
  reading.temperature_c = json.at("temperature_c").get<double>();
  reading.tilt_deg = json.at("tilt_deg").get<double>();
  if (!json.at("from").is_null()) {
    reading.from = device::parse_pose(json.at("from").get<std::string>()).value();
  }
  return reading;
}

nlohmann::ordered_json json_of(const JudgedPoses& judged) {
  nlohmann::ordered_json json;
  json["residual_mg"] = judged.poses.empty() ? nlohmann::ordered_json(nullptr)
                                             : nlohmann::ordered_json(judged.worst_mg);
  json["rms_mg"] = judged.poses.empty() ? nlohmann::ordered_json(nullptr)
                                        : nlohmann::ordered_json(judged.rms_mg);
  json["poses"] = nlohmann::ordered_json::array();
  for (const JudgedPose& pose : judged.poses) {
    nlohmann::ordered_json item = json_of(pose.reading);
    item["magnitude_g"] = pose.magnitude_g;
    item["error_mg"] = pose.error_mg;
    json["poses"].push_back(std::move(item));
  }
  return json;
}

// Standard uncertainties under the contract's names, then what they are made of and expanded to.
nlohmann::ordered_json uncertainty_to_json(const JigReport& report) {
  const double coverage = report.limits.decision.coverage_factor;
  nlohmann::ordered_json json = calib::to_json(report.combined);
  PerAxis<double> sensitivity_percent{};
  PerAxis<double> zero_mg{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    sensitivity_percent[axis] = 100 * coverage * report.combined.sensitivity_relative[axis];
    zero_mg[axis] = coverage * report.combined.zero_mg[axis];
  }
  json["coverage_factor"] = coverage;
  json["expanded"] = {{"sensitivity_percent", sensitivity_percent}, {"zero_mg", zero_mg}};
  json["budget"] = {{"noise_tilt_gravity", calib::to_json(report.six->best().uncertainty)},
                    {"gravity_relative", report.gravity.sd_g() / report.gravity.g()},
                    {"unused_poses_rms_mg", report.verification.rms_mg}};
  return json;
}

nlohmann::ordered_json json_of(const std::optional<device::CalibrationPage>& page) {
  if (!page) {
    return nullptr;
  }
  nlohmann::ordered_json json = calib::to_json(page->constants);
  json["calibrated"] = to_iso8601(page->calibrated);
  return json;
}

}  // namespace

JudgedPoses judge(const std::vector<PoseReading>& readings, const Calibration& calibration,
                  double gravity_g) {
  JudgedPoses judged;
  for (const PoseReading& reading : readings) {
    const PerAxis<double> force_g = calibration.to_g(reading.mean_lsb);
    JudgedPose pose;
    pose.reading = reading;
    pose.magnitude_g = std::hypot(force_g[0], force_g[1], force_g[2]);
    pose.error_mg = (pose.magnitude_g - gravity_g) * kMgPerG;
    judged.worst_mg = std::max(judged.worst_mg, std::abs(pose.error_mg));
    judged.rms_mg += pose.error_mg * pose.error_mg / static_cast<double>(readings.size());
    judged.poses.push_back(pose);
  }
  judged.rms_mg = std::sqrt(judged.rms_mg);
  return judged;
}

std::string JigReport::brief() const {
  std::string text = fmt::format("{} under '{}': {}", printable(serial), calib::to_string(filter),
                                 to_string(verdict));
  if (!verification.poses.empty()) {
    text += fmt::format("; {:.1f} mg off on {} poses that were not fitted", verification.worst_mg,
                        verification.poses.size());
  }
  for (const std::string& reason : reasons) {
    text += "; " + reason;
  }
  return text;
}

nlohmann::ordered_json JigReport::to_json() const {
  nlohmann::ordered_json json;
  json["serial"] = serial;
  json["firmware"] = firmware;
  json["jig"] = jig;
  json["filter"] = calib::to_string(filter);
  json["verdict"] = to_string(verdict);
  json["codes"] = codes;
  json["reasons"] = reasons;
  json["started"] = to_iso8601(started);
  json["ended"] = to_iso8601(ended);
  json["gravity_m_per_s2"] = gravity.m_per_s2;
  json["gravity_standard_uncertainty_m_per_s2"] = gravity.standard_uncertainty_m_per_s2;
  json["raw_sha256"] = raw_sha256();
  json["poses"] = nlohmann::ordered_json::array();
  for (const PoseReading& face : faces) {
    json["poses"].push_back(json_of(face));
  }
  if (six) {
    json["constants"] = calib::to_json(six->best().calibration, six->best().stored);
  } else {
    json["constants"] = nullptr;
  }
  json["method"] = method;
  json["as_found"] = json_of(as_found);
  if (as_found) {
    json["as_found"]["residual_mg"] = as_found_residual_mg;
  }
  json["as_left"] = json_of(as_left);
  if (as_left) {
    json["as_left"]["written"] = written;
    json["as_left"]["residual_mg"] = written ? nlohmann::ordered_json(recheck.worst_mg)
                                             : nlohmann::ordered_json(as_found_residual_mg);
  }
  json["verification"] = json_of(verification);
  json["verification"]["residual_rounded_mg"] = rounded_residual_mg;
  json["recheck"] = written ? json_of(recheck) : nlohmann::ordered_json(nullptr);
  json["uncertainty"] = six ? uncertainty_to_json(*this) : nlohmann::ordered_json(nullptr);
  json["limits"] = station::to_json(limits);
  json["quantities"] = nlohmann::ordered_json::array();
  for (const JudgedQuantity& quantity : quantities) {
    json["quantities"].push_back(station::to_json(quantity));
  }
  json["solutions"] = six ? calib::to_json(*six) : nlohmann::ordered_json(nullptr);
  json["refusals"] = refusals;
  json["stream"]["samples"] = stream.samples;
  json["stream"]["lost_samples"] = stream.lost_samples;
  json["stream"]["duplicate_reports"] = stream.duplicate_reports;
  json["stream"]["damaged_reports"] = stream.damaged_reports;
  json["stream"]["failed_transfers"] = stream.failed_transfers;
  json["stream"]["clock_jumps"] = stream.clock_jumps;
  return json;
}

std::string JigReport::raw_sha256() const {
  return to_hex(
      sha256(std::span(reinterpret_cast<const std::uint8_t*>(raw_csv.data()), raw_csv.size())));
}

calib::ConstantsRecord JigReport::record() const {
  calib::ConstantsRecord record;
  record.serial = serial;
  record.filter = filter;
  if (six) {
    record.calibration = six->best().calibration;
    record.stored = six->best().stored;
    record.uncertainty = combined;
  }
  record.method = method;
  record.made_at = ended;
  record.made_from.sha256 = raw_sha256();
  record.gravity_m_per_s2 = gravity.m_per_s2;
  return record;
}

nlohmann::ordered_json to_json(const JigProgress& progress) {
  nlohmann::ordered_json json;
  json["phase"] = to_string(progress.phase);
  json["refusals"] = progress.refusals;
  const auto list = [&json](const char* name, const std::vector<PoseReading>& readings) {
    json[name] = nlohmann::ordered_json::array();
    for (const PoseReading& reading : readings) {
      json[name].push_back(json_of(reading));
    }
  };
  list("faces", progress.faces);
  list("reversed", progress.reversed);
  list("reseat", progress.reseat);
  list("recheck", progress.recheck);
  return json;
}

Result<JigProgress> parse_jig_progress(const nlohmann::ordered_json& json) {
  // nlohmann and value() throw on what does not fit; it stops here.
  try {
    JigProgress progress;
    SIXPOINT_ASSIGN(progress.phase, parse_jig_phase(json.at("phase").get<std::string>()));
    progress.refusals = json.at("refusals").get<int>();
    const auto list = [&json](const char* name, std::vector<PoseReading>& readings) {
      for (const auto& item : json.at(name)) {
        readings.push_back(parse_reading(item));
      }
    };
    list("faces", progress.faces);
    list("reversed", progress.reversed);
    list("reseat", progress.reseat);
    list("recheck", progress.recheck);
    return progress;
  } catch (const std::exception& error) {
    return fail(ErrorCode::bad_data, fmt::format("the state of a run does not hold together: {}",
                                                 printable(error.what(), 120)));
  }
}

JigReport interrupted_report(const JigResume& resume, const std::string& serial,
                             const std::string& firmware, const JigSessionOptions& options,
                             UtcTime ended, const std::string& reason) {
  JigReport report;
  report.serial = serial;
  report.firmware = firmware;
  report.filter = options.filter;
  report.gravity = options.gravity;
  report.started = resume.started;
  report.ended = ended;
  report.verdict = JigVerdict::inconclusive;
  report.codes = {"unit_gone"};
  report.limits = options.limits;
  report.reasons.push_back(reason);
  report.faces = resume.progress.faces;
  report.as_found = resume.as_found;
  report.as_left = resume.written ? resume.written : resume.as_found;
  report.written = resume.written.has_value();
  report.refusals = resume.progress.refusals;
  report.raw_csv = resume.raw_csv;
  return report;
}

Result<JigReport> run_jig(device::Unit& unit, device::Jig& jig, Env& env,
                          const JigSessionOptions& options, const JigTeller& tell) {
  JigHooks hooks;
  hooks.tell = tell;
  return run_jig({&unit, &jig}, env, options, hooks);
}

Result<JigReport> run_jig(UnitOnJig on_jig, Env& env, const JigSessionOptions& options,
                          const JigHooks& hooks, const std::optional<JigResume>& resume) {
  if (options.run.write && options.filter != FilterConfiguration::current) {
    return fail(ErrorCode::usage, "only constants of the filter 'current' are written into units",
                {}, "leave out --write or --filter");
  }
  return Session(on_jig, env, options, hooks).run(resume);
}

}  // namespace sixpoint::station
