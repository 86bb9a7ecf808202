#include "station/jig_run.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace sixpoint::station {

std::string_view to_string(JigPhase phase) {
  switch (phase) {
    case JigPhase::measuring:
      return "measuring";
    case JigPhase::verifying:
      return "verifying";
    case JigPhase::reseating:
      return "reseating";
    case JigPhase::writing:
      return "writing";
    case JigPhase::rechecking:
      return "rechecking";
    case JigPhase::finished:
      return "finished";
  }
  return "?";
}

Result<JigPhase> parse_jig_phase(std::string_view text) {
  for (const JigPhase phase : {JigPhase::measuring, JigPhase::verifying, JigPhase::reseating,
                               JigPhase::writing, JigPhase::rechecking, JigPhase::finished}) {
    if (to_string(phase) == text) {
      return phase;
    }
  }
  return fail(ErrorCode::bad_data,
              fmt::format("'{}' is no phase of a jig run", printable(text, 40)));
}

std::string_view to_string(JigStillness stillness) {
  switch (stillness) {
    case JigStillness::moving:
      return "moving";
    case JigStillness::settling:
      return "settling";
    case JigStillness::dwelling:
      return "dwelling";
    case JigStillness::leaving:
      return "leaving";
  }
  return "?";
}

std::string_view to_string(JigOutcome outcome) {
  switch (outcome) {
    case JigOutcome::running:
      return "running";
    case JigOutcome::complete:
      return "complete";
    case JigOutcome::timed_out:
      return "timed_out";
    case JigOutcome::too_many_refusals:
      return "too_many_refusals";
    case JigOutcome::stopped:
      return "stopped";
    case JigOutcome::unit_gone:
      return "unit_gone";
    case JigOutcome::sensor_stuck:
      return "sensor_stuck";
  }
  return "?";
}

double dwell_budget_s(const JigRunOptions& options) {
  const std::size_t poses = device::kPoses.size() + options.verification.size() +
                            options.reseat.size() + (options.write ? options.recheck.size() : 0);
  return static_cast<double>(poses) * (options.window_s + options.settle_s + options.dwell_s);
}

JigRun::JigRun(JigRunOptions options, const calib::Calibration& approximation)
    : options_(std::move(options)),
      approximation_(approximation),
      nominal_(first_approximation(std::nullopt).calibration),
      open_(device::kPoses.begin(), device::kPoses.end()) {}

void JigRun::resume(const JigProgress& progress) {
  phase_ = progress.phase == JigPhase::finished ? JigPhase::reseating : progress.phase;
  faces_ = progress.faces;
  reversed_ = progress.reversed;
  reseat_ = progress.reseat;
  recheck_ = progress.recheck;
  refusals_ = progress.refusals;
  open_ = wanted_in(phase_);
  for (const PoseReading& reading : readings_of_phase()) {
    std::erase(open_, reading.pose);
  }
}

JigProgress JigRun::progress() const {
  return {phase_, faces_, reversed_, reseat_, recheck_, refusals_};
}

std::vector<PoseReading> JigRun::verification() const {
  std::vector<PoseReading> readings = reversed_;
  readings.insert(readings.end(), reseat_.begin(), reseat_.end());
  return readings;
}

JigLive JigRun::live() const {
  JigLive live;
  live.stillness = state_;
  if (!recent_.empty()) {
    live.face = recognise(window().mean_lsb);
  }
  live.dwell_fraction = std::min(
      1.0, static_cast<double>(dwell_.size()) / std::max(1.0, options_.dwell_s * options_.rate_hz));
  return live;
}

std::vector<JigAction> JigRun::start(double now_s) {
  now_s_ = now_s;
  last_progress_s_ = now_s;
  if (phase_ != JigPhase::measuring) {
    actions_.push_back({JigAction::Kind::fit, Pose::plus_z, "all six faces are taken"});
  }
  if (phase_ == JigPhase::writing) {
    actions_.push_back({JigAction::Kind::write, Pose::plus_z, "writing the constants"});
  } else if (open_.empty()) {
    next_phase();
  } else {
    ask_next();
  }
  return std::exchange(actions_, {});
}

const std::vector<PoseReading>& JigRun::readings_of(JigPhase phase) const {
  return phase == JigPhase::measuring   ? faces_
         : phase == JigPhase::verifying ? reversed_
         : phase == JigPhase::reseating ? reseat_
                                        : recheck_;
}

const std::vector<Pose>& JigRun::wanted_in(JigPhase phase) const {
  static const std::vector<Pose> kAll(device::kPoses.begin(), device::kPoses.end());
  static const std::vector<Pose> kNone;
  switch (phase) {
    case JigPhase::measuring:
      return kAll;
    case JigPhase::verifying:
      return options_.verification;
    case JigPhase::reseating:
      return options_.reseat;
    case JigPhase::rechecking:
      return options_.recheck;
    case JigPhase::writing:
    case JigPhase::finished:
      break;
  }
  return kNone;
}

// Would a reading of `pose`, reached from `from`, be another side of approach than the first one?
bool JigRun::from_other_side(Pose pose, Pose from) const {
  return pose != from && std::none_of(faces_.begin(), faces_.end(), [&](const PoseReading& face) {
           return face.pose == pose && face.from == from;
         });
}

void JigRun::ask_next() {
  if (open_.empty()) {
    return;
  }
  detour_.reset();
  const auto describe = [](Pose pose) {
    return fmt::format("{}: its {} axis points {}", device::to_string(pose),
                       kAxisNames[device::axis_of(pose)],
                       device::sign_of(pose) > 0 ? "up" : "down");
  };
  if (phase_ == JigPhase::verifying && last_face_) {
    // First a face that lies well from here; where there is none, one to come from.
    const auto good = std::find_if(open_.begin(), open_.end(),
                                   [&](Pose pose) { return from_other_side(pose, *last_face_); });
    if (good != open_.end()) {
      std::rotate(open_.begin(), good, good + 1);
    } else {
      for (const Pose by_way_of : device::kPoses) {
        if (by_way_of != *last_face_ && from_other_side(open_.front(), by_way_of)) {
          detour_ = by_way_of;
          actions_.push_back({JigAction::Kind::place, by_way_of,
                              fmt::format("lay the unit on {} for a moment, so that it comes to {} "
                                          "from another side",
                                          describe(by_way_of), device::to_string(open_.front()))});
          return;
        }
      }
    }
  }
  actions_.push_back(
      {JigAction::Kind::place, open_.front(),
       fmt::format("{} {}",
                   phase_ == JigPhase::reseating ? "take the unit off, put it back and turn it to"
                                                 : "turn the unit to",
                   describe(open_.front()))});
}

void JigRun::finish(JigOutcome outcome, std::string text) {
  phase_ = JigPhase::finished;
  outcome_ = outcome;
  open_.clear();
  dwell_.clear();
  actions_.push_back({JigAction::Kind::finished, Pose::plus_z, std::move(text)});
}

std::vector<JigAction> JigRun::on_loss() {
  recent_.clear();
  sum_ = {};
  sum_square_ = {};
  dwell_.clear();
  still_samples_ = 0;
  if (state_ != State::leaving) {
    state_ = State::moving;
  }
  return std::exchange(actions_, {});
}

std::vector<JigAction> JigRun::on_sample(const Sample& sample) {
  now_s_ = sample.time_s;
  if (phase_ == JigPhase::finished || phase_ == JigPhase::writing) {
    return std::exchange(actions_, {});
  }
  if (is_stuck(sample.counts)) {
    return std::exchange(actions_, {});
  }
  recent_.push_back(sample.counts);
  const auto wanted = static_cast<std::size_t>(options_.window_s * options_.rate_hz);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const std::int64_t count = sample.counts[axis];
    sum_[axis] += count;
    sum_square_[axis] += count * count;
    if (recent_.size() > wanted) {
      const std::int64_t old = recent_.front()[axis];
      sum_[axis] -= old;
      sum_square_[axis] -= old * old;
    }
  }
  if (recent_.size() > wanted) {
    recent_.pop_front();
  }
  if (recent_.size() < wanted) {
    return std::exchange(actions_, {});
  }

  const Window now = window();
  const bool still = is_still(now, state_ != State::moving);
  if (!still) {
    if (state_ == State::dwelling) {
      refuse(recognise(dwell_start_lsb_).pose, "moved during the reading");
    }
    state_ = State::moving;
    still_samples_ = 0;
    return std::exchange(actions_, {});
  }
  ++still_samples_;
  switch (state_) {
    case State::moving:
      state_ = State::settling;
      break;
    case State::settling: {
      // A second of window without movement in it, and then the ringing of the mount.
      if (still_samples_ < static_cast<int>(options_.settle_s * options_.rate_hz)) {
        break;
      }
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        double& own = own_noise_mg_[axis];
        own = own > 0 ? std::min(own, now.sd_mg[axis]) : now.sd_mg[axis];
      }
      begin_dwell();
      break;
    }
    case State::dwelling: {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        const double moved_mg =
            std::abs(now.mean_lsb[axis] - dwell_start_lsb_[axis]) * g_per_lsb(axis) * kMgPerG;
        if (moved_mg > options_.moved_mg) {
          refuse(recognise(dwell_start_lsb_).pose, "moved during the reading");
          return std::exchange(actions_, {});
        }
      }
      dwell_.push_back(sample);
      if (dwell_.size() >= static_cast<std::size_t>(options_.dwell_s * options_.rate_hz)) {
        finish_dwell();
      }
      break;
    }
    case State::leaving: {
      // Until it moves. Where the turn itself fell into a loss of samples, the reading tells.
      constexpr double kTurned_g = 0.3;
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        if (std::abs(now.mean_lsb[axis] - left_lsb_[axis]) * g_per_lsb(axis) > kTurned_g) {
          state_ = State::settling;
          still_samples_ = 0;
        }
      }
      break;
    }
  }
  return std::exchange(actions_, {});
}

void JigRun::leave() {
  dwell_.clear();
  state_ = State::leaving;
  if (!recent_.empty()) {
    left_lsb_ = window().mean_lsb;
  }
}

void JigRun::begin_dwell() {
  const Window now = window();
  const NearestFace face = recognise(now.mean_lsb);
  const bool between = face.angle_deg > options_.between_faces_deg;
  if (between && !(phase_ == JigPhase::measuring && between_faces_lsb_ &&
                   same_placement(now.mean_lsb, *between_faces_lsb_))) {
    between_faces_lsb_ = now.mean_lsb;
    refuse(face.pose, fmt::format("lies on none of its six faces: tilted {:.1f} degrees from {}",
                                  face.angle_deg, device::to_string(face.pose)));
    return;
  }
  if (last_face_ != face.pose) {
    came_from_ = std::exchange(last_face_, face.pose);
  }
  if (detour_ == face.pose) {
    leave();
    ask_next();
    return;
  }
  if (const std::string reason = why_not_open(face.pose); !reason.empty()) {
    refuse(face.pose, reason);
    return;
  }
  dwell_.clear();
  dwell_start_lsb_ = now.mean_lsb;
  state_ = State::dwelling;
}

// Empty when a reading of this face is wanted now.
std::string JigRun::why_not_open(Pose pose) const {
  if (std::find(open_.begin(), open_.end(), pose) == open_.end()) {
    for (const PoseReading& reading : readings_of_phase()) {
      if (reading.pose == pose) {
        return fmt::format("{} is done already", device::to_string(pose));
      }
    }
    return fmt::format("wrong face: this is {}, wanted is {}", device::to_string(pose),
                       device::to_string(open_.front()));
  }
  if (phase_ == JigPhase::verifying && came_from_ && !from_other_side(pose, *came_from_)) {
    return fmt::format("{} was reached from {} in the first round too; come from another face",
                       device::to_string(pose), device::to_string(*came_from_));
  }
  return {};
}

void JigRun::refuse(Pose pose, std::string reason) {
  leave();
  ++refusals_;
  ++refusals_in_row_;
  actions_.push_back({JigAction::Kind::refused, pose, std::move(reason)});
  if (refusals_in_row_ >= options_.refusals_in_row || refusals_ >= 5 * options_.refusals_in_row) {
    finish(JigOutcome::too_many_refusals,
           fmt::format("{} placements were refused, {} of them in a row", refusals_,
                       refusals_in_row_));
    return;
  }
  ask_next();
}

void JigRun::next_phase() {
  switch (phase_) {
    case JigPhase::measuring:
      actions_.push_back({JigAction::Kind::fit, Pose::plus_z, "all six faces are taken"});
      phase_ = JigPhase::verifying;
      open_ = options_.verification;
      break;
    case JigPhase::verifying:
      phase_ = JigPhase::reseating;
      open_ = options_.reseat;
      break;
    case JigPhase::reseating:
      if (options_.write) {
        phase_ = JigPhase::writing;
        actions_.push_back({JigAction::Kind::write, Pose::plus_z, "writing the constants"});
        return;
      }
      finish(JigOutcome::complete, "the run is complete");
      return;
    case JigPhase::writing:
      phase_ = JigPhase::rechecking;
      open_ = options_.recheck;
      break;
    case JigPhase::rechecking:
    case JigPhase::finished:
      finish(JigOutcome::complete, "the run is complete");
      return;
  }
  if (open_.empty()) {
    next_phase();
  } else {
    ask_next();
  }
}

std::vector<JigAction> JigRun::on_written(double now_s) {
  now_s_ = now_s;
  last_progress_s_ = now_s;
  if (phase_ == JigPhase::writing) {
    // Same readings as before until it is turned: the window starts anew.
    on_loss();
    state_ = State::leaving;
    next_phase();
  }
  return std::exchange(actions_, {});
}

std::vector<JigAction> JigRun::on_operator(OperatorWord word) {
  if (phase_ == JigPhase::finished) {
    return {};
  }
  if (word == OperatorWord::stop) {
    finish(JigOutcome::stopped, "stopped by the operator");
    return std::exchange(actions_, {});
  }
  if (phase_ == JigPhase::writing) {
    return {};
  }
  // The last reading of a phase can be taken back too; what was written stays written.
  if (readings_of_phase().empty() &&
      (phase_ == JigPhase::verifying || phase_ == JigPhase::reseating)) {
    phase_ = phase_ == JigPhase::verifying ? JigPhase::measuring : JigPhase::verifying;
    open_.clear();
  }
  std::vector<PoseReading>& readings = readings_of_phase();
  if (!readings.empty()) {
    const Pose pose = readings.back().pose;
    readings.pop_back();
    open_.insert(open_.begin(), pose);
    last_refused_.reset();
    leave();
    actions_.push_back(
        {JigAction::Kind::dropped, pose, fmt::format("{} is taken back", device::to_string(pose))});
    ask_next();
  }
  return std::exchange(actions_, {});
}

std::vector<JigAction> JigRun::on_time(double now_s) {
  now_s_ = now_s;
  if (phase_ != JigPhase::finished && now_s - last_progress_s_ > options_.pose_time_out_s) {
    finish(JigOutcome::timed_out,
           fmt::format("nothing was accepted for {:.0f} s", options_.pose_time_out_s));
  }
  return std::exchange(actions_, {});
}

std::vector<JigAction> JigRun::on_unit_back(double now_s) {
  now_s_ = now_s;
  last_progress_s_ = now_s;
  state_ = State::moving;
  last_face_.reset();
  came_from_.reset();
  return on_loss();
}

std::vector<JigAction> JigRun::on_unit_gone() {
  if (phase_ != JigPhase::finished) {
    finish(JigOutcome::unit_gone, "the unit is gone");
  }
  return std::exchange(actions_, {});
}

}  // namespace sixpoint::station
