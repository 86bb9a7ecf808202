#include "station/run/jig_run.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace sixpoint::station {

namespace {

// In the order of the enumerators.
constexpr std::array<std::string_view, 7> kPhases = {
    "measuring", "verifying", "reseating", "turning", "writing", "rechecking", "finished"};
constexpr std::array<std::string_view, 2> kProtocols = {"production", "production+"};
constexpr std::array<std::string_view, 4> kStillness = {"moving", "settling", "dwelling",
                                                        "leaving"};
constexpr std::array<std::string_view, 7> kOutcomes = {"running",           "complete", "timed_out",
                                                       "too_many_refusals", "stopped",  "unit_gone",
                                                       "sensor_stuck"};
// The run's own judgement comes first (jig_session.cpp): a unit that failed is not written.
constexpr const char* kWriting = "the constants are judged, and written if the unit passed";
// The run ends after this many times refusals_in_row in all.
constexpr int kMostRefusals = 5;
// The unit was turned although the turn itself was not in the samples.
constexpr double kTurned_mg = 300;

std::string describe(Pose pose) {
  return fmt::format("{}: its {} axis points {}", device::to_string(pose),
                     kAxisNames[device::axis_of(pose)], device::sign_of(pose) > 0 ? "up" : "down");
}

// The table of jig_run.h, in words for the person.
std::string describe_turned(Pose pose, int turned_deg) {
  if (device::axis_of(pose) == 0) {
    return turned_deg == 0 ? "its y axis away from you" : "its y axis towards you";
  }
  return turned_deg == 0 ? "its x axis to the right" : "its x axis to the left";
}

}  // namespace

std::string_view to_string(JigPhase phase) { return kPhases[static_cast<std::size_t>(phase)]; }
std::string_view to_string(JigStillness stillness) {
  return kStillness[static_cast<std::size_t>(stillness)];
}
std::string_view to_string(JigOutcome outcome) {
  return kOutcomes[static_cast<std::size_t>(outcome)];
}

Result<JigPhase> parse_jig_phase(std::string_view text) {
  const auto found = std::find(kPhases.begin(), kPhases.end(), text);
  if (found == kPhases.end()) {
    return fail(ErrorCode::bad_data,
                fmt::format("'{}' is no phase of a jig run", printable(text, 40)));
  }
  return static_cast<JigPhase>(found - kPhases.begin());
}

std::string_view to_string(JigProtocol protocol) {
  return kProtocols[static_cast<std::size_t>(protocol)];
}

Result<JigProtocol> parse_jig_protocol(std::string_view text) {
  const auto found = std::find(kProtocols.begin(), kProtocols.end(), text);
  if (found == kProtocols.end()) {
    return fail(ErrorCode::usage,
                fmt::format("'{}' is no protocol of a jig run", printable(text, 40)), "--protocol",
                "production or production+");
  }
  return static_cast<JigProtocol>(found - kProtocols.begin());
}

std::size_t placements_of(const JigRunOptions& options) {
  return device::kPoses.size() + options.verification.size() + options.reseat.size() +
         (options.protocol == JigProtocol::production_plus ? options.half_turn.size() : 0) +
         (options.write ? options.recheck.size() : 0);
}

double dwell_budget_s(const JigRunOptions& options) {
  return static_cast<double>(placements_of(options)) *
         (options.window_s + options.settle_s + options.dwell_s);
}

JigRun::JigRun(JigRunOptions options, const calib::Calibration& approximation)
    : options_(std::move(options)),
      approximation_(approximation),
      open_(device::kPoses.begin(), device::kPoses.end()),
      window_(static_cast<std::size_t>(options_.window_s * options_.rate_hz)) {}

void JigRun::resume(const JigProgress& progress) {
  progress_ = progress;
  if (progress_.phase == JigPhase::finished) {
    progress_.phase =
        options_.protocol == JigProtocol::production_plus ? JigPhase::turning : JigPhase::reseating;
  }
  open_ = wanted_in(progress_.phase);
  for (const PoseReading& reading : readings()) {
    std::erase(open_, reading.pose);
  }
  if (progress_.phase == JigPhase::turning) {
    const auto& last = progress_.half_turn.empty() ? progress_.reseat : progress_.half_turn;
    read_lsb_ = last.empty() ? read_lsb_ : last.back().mean_lsb;
  }
}

std::vector<PoseReading> JigRun::verification() const {
  std::vector<PoseReading> all = progress_.reversed;
  all.insert(all.end(), progress_.reseat.begin(), progress_.reseat.end());
  return all;
}

JigLive JigRun::live() const {
  JigLive live;
  live.stillness = stillness_;
  if (!window_.empty()) {
    live.face = recognise(window_.mean_lsb());
  }
  live.dwell_fraction = std::min(
      1.0, static_cast<double>(dwell_.size()) / std::max(1.0, options_.dwell_s * options_.rate_hz));
  return live;
}

std::vector<JigAction> JigRun::start(double now_s) {
  now_s_ = now_s;
  last_progress_s_ = now_s;
  if (progress_.phase != JigPhase::measuring) {
    actions_.push_back({JigAction::Kind::fit, Pose::plus_z, "all six faces are taken"});
  }
  if (progress_.phase == JigPhase::writing) {
    actions_.push_back({JigAction::Kind::write, Pose::plus_z, kWriting});
  } else {
    ask_next_or_end_phase();
  }
  return answer();
}

std::vector<PoseReading>& JigRun::readings() {
  return progress_.phase == JigPhase::measuring   ? progress_.faces
         : progress_.phase == JigPhase::verifying ? progress_.reversed
         : progress_.phase == JigPhase::reseating ? progress_.reseat
         : progress_.phase == JigPhase::turning   ? progress_.half_turn
                                                  : progress_.recheck;
}

const std::vector<Pose>& JigRun::wanted_in(JigPhase phase) const {
  static const std::vector<Pose> kAll(device::kPoses.begin(), device::kPoses.end());
  static const std::vector<Pose> kNone;
  return phase == JigPhase::measuring    ? kAll
         : phase == JigPhase::verifying  ? options_.verification
         : phase == JigPhase::reseating  ? options_.reseat
         : phase == JigPhase::turning    ? options_.half_turn
         : phase == JigPhase::rechecking ? options_.recheck
                                         : kNone;
}

// Whether `pose`, reached from `from`, is approached from another side than in the first round.
bool JigRun::from_other_side(Pose pose, Pose from) const {
  return pose != from &&
         std::none_of(progress_.faces.begin(), progress_.faces.end(), [&](const PoseReading& face) {
           return face.pose == pose && face.from == from;
         });
}

// Puts a face first that can be reached from here. Where there is none, asks for a face to come
// from, and returns true.
bool JigRun::ask_detour() {
  const auto good = std::find_if(open_.begin(), open_.end(),
                                 [&](Pose pose) { return from_other_side(pose, *last_face_); });
  if (good != open_.end()) {
    std::rotate(open_.begin(), good, good + 1);
    return false;
  }
  const auto by_way_of = std::find_if(device::kPoses.begin(), device::kPoses.end(), [&](Pose pose) {
    return pose != *last_face_ && from_other_side(open_.front(), pose);
  });
  if (by_way_of == device::kPoses.end()) {
    return false;
  }
  detour_ = *by_way_of;
  actions_.push_back(
      {JigAction::Kind::place, *by_way_of,
       fmt::format("lay the unit on {} for a moment, so that it comes to {} from another side",
                   describe(*by_way_of), device::to_string(open_.front()))});
  return true;
}

void JigRun::ask_next() {
  if (open_.empty()) {
    return;
  }
  detour_.reset();
  if (progress_.phase == JigPhase::verifying && last_face_ && ask_detour()) {
    return;
  }
  if (progress_.phase == JigPhase::turning && last_face_ == open_.front()) {
    std::rotate(open_.begin(), open_.begin() + 1, open_.end());  // it must be tipped in between
  }
  const Pose pose = open_.front();
  std::string text = progress_.phase == JigPhase::reseating
                         ? "take the unit off, put it back and turn it to"
                     : progress_.phase == JigPhase::turning
                         ? "lay the unit, turned by half a turn about the vertical, on"
                         : "turn the unit to";
  text += ' ' + describe(pose);
  if (const auto turned = turned_deg()) {
    text += ", " + describe_turned(pose, *turned);
  }
  actions_.push_back({JigAction::Kind::place, pose, std::move(text)});
}

std::optional<int> JigRun::turned_deg() const {
  if (options_.protocol == JigProtocol::production) {
    return std::nullopt;
  }
  return progress_.phase == JigPhase::turning ? 180 : 0;
}

void JigRun::ask_next_or_end_phase() {
  if (open_.empty()) {
    next_phase();
  } else {
    ask_next();
  }
}

void JigRun::next_phase() {
  switch (progress_.phase) {
    case JigPhase::measuring:
      actions_.push_back({JigAction::Kind::fit, Pose::plus_z, "all six faces are taken"});
      progress_.phase = JigPhase::verifying;
      break;
    case JigPhase::verifying:
      progress_.phase = JigPhase::reseating;
      break;
    case JigPhase::reseating:
      if (options_.protocol == JigProtocol::production) {
        write_or_finish();
        return;
      }
      progress_.phase = JigPhase::turning;
      break;
    case JigPhase::turning:
      write_or_finish();
      return;
    case JigPhase::writing:
      progress_.phase = JigPhase::rechecking;
      break;
    case JigPhase::rechecking:
    case JigPhase::finished:
      finish(JigOutcome::complete, "the run is complete");
      return;
  }
  open_ = wanted_in(progress_.phase);
  ask_next_or_end_phase();
}

void JigRun::write_or_finish() {
  if (options_.write) {
    progress_.phase = JigPhase::writing;
    actions_.push_back({JigAction::Kind::write, Pose::plus_z, kWriting});
  } else {
    finish(JigOutcome::complete, "the run is complete");
  }
}

void JigRun::finish(JigOutcome outcome, std::string text) {
  progress_.phase = JigPhase::finished;
  outcome_ = outcome;
  open_.clear();
  dwell_.clear();
  actions_.push_back({JigAction::Kind::finished, Pose::plus_z, std::move(text)});
}

// Empty when a reading of this face is wanted now.
std::string JigRun::why_not_wanted(Pose pose) const {
  if (std::find(open_.begin(), open_.end(), pose) == open_.end()) {
    const std::vector<Pose>& wanted = wanted_in(progress_.phase);
    if (std::find(wanted.begin(), wanted.end(), pose) != wanted.end()) {
      return fmt::format("{} is done already", device::to_string(pose));
    }
    return fmt::format("wrong face: this is {}, wanted is {}", device::to_string(pose),
                       device::to_string(open_.front()));
  }
  if (progress_.phase == JigPhase::verifying && came_from_ && !from_other_side(pose, *came_from_)) {
    return fmt::format("{} was reached from {} in the first round too; come from another face",
                       device::to_string(pose), device::to_string(*came_from_));
  }
  if (progress_.phase == JigPhase::turning && !tipped_) {
    return fmt::format(
        "not turned: it lies on {} as at the last reading, and was not tipped since; lift it, lay "
        "it on another side, then on {} turned by half a turn",
        device::to_string(pose), device::to_string(pose));
  }
  return {};
}

void JigRun::accept(const PoseReading& reading) {
  if (last_refused_ && last_refused_->pose == reading.pose) {
    last_refused_.reset();
  }
  between_faces_lsb_.reset();
  refusals_in_row_ = 0;
  last_progress_s_ = now_s_;
  std::erase(open_, reading.pose);
  readings().push_back(reading);
  read_lsb_ = reading.mean_lsb;
  tipped_ = false;
  actions_.push_back({JigAction::Kind::accepted, reading.pose,
                      fmt::format("{} is taken", device::to_string(reading.pose))});
  leave();
  ask_next_or_end_phase();
}

void JigRun::refuse(Pose pose, std::string reason, JigAction::Refusal refusal) {
  leave();
  ++progress_.refusals;
  ++refusals_in_row_;
  actions_.push_back({JigAction::Kind::refused, pose, std::move(reason), refusal});
  if (refusals_in_row_ >= options_.refusals_in_row ||
      progress_.refusals >= kMostRefusals * options_.refusals_in_row) {
    finish(JigOutcome::too_many_refusals,
           fmt::format("{} placements were refused, {} of them in a row", progress_.refusals,
                       refusals_in_row_));
    return;
  }
  ask_next();
}

void JigRun::leave() {
  dwell_.clear();
  stillness_ = JigStillness::leaving;
  if (!window_.empty()) {
    left_lsb_ = window_.mean_lsb();
  }
}

std::vector<JigAction> JigRun::on_sample(const Sample& sample) {
  now_s_ = sample.time_s;
  if (progress_.phase == JigPhase::finished || progress_.phase == JigPhase::writing) {
    return answer();
  }
  const bool full = window_.add(sample.counts);
  if (is_stuck(sample.counts) || !full) {
    return answer();
  }
  if (progress_.phase == JigPhase::turning && !tipped_) {
    tipped_ = !read_lsb_ || has_moved(*read_lsb_, kTurned_mg);
  }
  if (!is_still()) {
    if (stillness_ == JigStillness::dwelling) {
      refuse(recognise(dwell_start_lsb_).pose, "moved during the reading");
    }
    stillness_ = JigStillness::moving;
    still_samples_ = 0;
    return answer();
  }
  ++still_samples_;
  switch (stillness_) {
    case JigStillness::moving:
      stillness_ = JigStillness::settling;
      break;
    case JigStillness::settling:
      if (still_samples_ >= static_cast<int>(options_.settle_s * options_.rate_hz)) {
        on_settled();
      }
      break;
    case JigStillness::dwelling:
      if (has_moved(dwell_start_lsb_, options_.moved_mg)) {
        refuse(recognise(dwell_start_lsb_).pose, "moved during the reading");
        break;
      }
      dwell_.push_back(sample);
      if (dwell_.size() >= static_cast<std::size_t>(options_.dwell_s * options_.rate_hz)) {
        finish_dwell();
      }
      break;
    case JigStillness::leaving:
      if (has_moved(left_lsb_, kTurned_mg)) {
        stillness_ = JigStillness::settling;
        still_samples_ = 0;
      }
      break;
  }
  return answer();
}

std::vector<JigAction> JigRun::on_loss() {
  window_.clear();
  dwell_.clear();
  still_samples_ = 0;
  if (stillness_ != JigStillness::leaving) {
    stillness_ = JigStillness::moving;
  }
  return answer();
}

std::vector<JigAction> JigRun::on_written(double now_s) {
  now_s_ = now_s;
  last_progress_s_ = now_s;
  if (progress_.phase == JigPhase::writing) {
    on_loss();
    stillness_ = JigStillness::leaving;  // a reading begins after the unit was turned
    next_phase();
  }
  return answer();
}

std::vector<JigAction> JigRun::on_operator(OperatorCommand command) {
  if (progress_.phase == JigPhase::finished) {
    return {};
  }
  if (command == OperatorCommand::stop) {
    finish(JigOutcome::stopped, "stopped by the operator");
    return answer();
  }
  if (progress_.phase == JigPhase::writing) {
    return {};
  }
  // The last reading of the phase before can be taken back too; what was written stays written.
  if (readings().empty() &&
      (progress_.phase == JigPhase::verifying || progress_.phase == JigPhase::reseating ||
       progress_.phase == JigPhase::turning)) {
    progress_.phase = progress_.phase == JigPhase::verifying   ? JigPhase::measuring
                      : progress_.phase == JigPhase::reseating ? JigPhase::verifying
                                                               : JigPhase::reseating;
    open_.clear();
  }
  if (!readings().empty()) {
    const Pose pose = readings().back().pose;
    readings().pop_back();
    open_.insert(open_.begin(), pose);
    last_refused_.reset();
    leave();
    actions_.push_back(
        {JigAction::Kind::dropped, pose, fmt::format("{} is taken back", device::to_string(pose))});
    ask_next();
  }
  return answer();
}

std::vector<JigAction> JigRun::on_time(double now_s) {
  now_s_ = now_s;
  const double time_out_s = options_.pose_time_out_s + options_.dwell_s;
  if (progress_.phase != JigPhase::finished && now_s - last_progress_s_ > time_out_s) {
    finish(JigOutcome::timed_out, fmt::format("nothing was accepted for {:.0f} s", time_out_s));
  }
  return answer();
}

std::vector<JigAction> JigRun::on_unit_back(double now_s) {
  now_s_ = now_s;
  last_progress_s_ = now_s;
  stillness_ = JigStillness::moving;
  last_face_.reset();
  came_from_.reset();
  return on_loss();
}

std::vector<JigAction> JigRun::on_unit_gone() {
  if (progress_.phase != JigPhase::finished) {
    finish(JigOutcome::unit_gone, "the unit is gone");
  }
  return answer();
}

}  // namespace sixpoint::station
