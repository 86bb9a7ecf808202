#include "station/jig_run.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

namespace sixpoint::station {

namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;
// The ADXL362's 12 bits: at these a reading says nothing.
constexpr int kRawMin = -2048;
constexpr int kRawMax = 2047;

}  // namespace

NearestFace nearest_face(const PerAxis<double>& force_g) {
  std::size_t axis = 0;
  double square = 0;
  for (std::size_t i = 0; i < kAxes; ++i) {
    square += force_g[i] * force_g[i];
    if (std::abs(force_g[i]) > std::abs(force_g[axis])) {
      axis = i;
    }
  }
  const double norm = std::sqrt(square);
  const double cosine = norm > 0 ? std::abs(force_g[axis]) / norm : 0;
  return {device::pose_of(axis, force_g[axis] > 0 ? 1 : -1),
          std::acos(std::clamp(cosine, -1.0, 1.0)) * kDegPerRad};
}

std::string_view to_string(JigPhase phase) {
  switch (phase) {
    case JigPhase::measuring:
      return "measuring";
    case JigPhase::verifying:
      return "verifying";
    case JigPhase::writing:
      return "writing";
    case JigPhase::rechecking:
      return "rechecking";
    case JigPhase::finished:
      return "finished";
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
  }
  return "?";
}

double dwell_budget_s(const JigRunOptions& options) {
  const std::size_t poses = device::kPoses.size() + options.verification.size() +
                            (options.write ? options.recheck.size() : 0);
  return static_cast<double>(poses) * (options.window_s + options.settle_s + options.dwell_s);
}

JigRun::JigRun(JigRunOptions options, const calib::Calibration& approximation)
    : options_(std::move(options)),
      approximation_(approximation),
      open_(device::kPoses.begin(), device::kPoses.end()) {}

std::vector<JigAction> JigRun::start(double now_s) {
  now_s_ = now_s;
  last_progress_s_ = now_s;
  ask_next();
  return std::exchange(actions_, {});
}

std::vector<PoseReading>& JigRun::readings_of_phase() {
  return phase_ == JigPhase::measuring   ? faces_
         : phase_ == JigPhase::verifying ? verification_
                                         : recheck_;
}

void JigRun::ask_next() {
  if (!open_.empty()) {
    actions_.push_back(
        {JigAction::Kind::place, open_.front(),
         fmt::format("turn the unit to {}: its {} axis points {}", device::to_string(open_.front()),
                     kAxisNames[device::axis_of(open_.front())],
                     device::sign_of(open_.front()) > 0 ? "up" : "down")});
  }
}

void JigRun::finish(JigOutcome outcome, std::string text) {
  phase_ = JigPhase::finished;
  outcome_ = outcome;
  open_.clear();
  dwell_.clear();
  actions_.push_back({JigAction::Kind::finished, Pose::plus_z, std::move(text)});
}

JigRun::Window JigRun::window() const {
  Window window;
  const auto n = static_cast<double>(recent_.size());
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto sum = static_cast<double>(sum_[axis]);
    window.mean_lsb[axis] = sum / n;
    const double variance =
        (static_cast<double>(sum_square_[axis]) - sum * sum / n) / std::max(1.0, n - 1);
    window.sd_mg[axis] = std::sqrt(std::max(0.0, variance)) * g_per_lsb(axis) * kMgPerG;
  }
  return window;
}

bool JigRun::is_still(const Window& window, bool already) const {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const double own = own_noise_mg_[axis];
    const double factor = already ? options_.moved_factor : options_.still_factor;
    // 2 mg: half a count; a quiet sensor's noise sinks into its rounding.
    const double limit = own > 0 ? factor * std::max(own, 2.0) : options_.first_noise_limit_mg;
    if (window.sd_mg[axis] > std::min(limit, options_.first_noise_limit_mg)) {
      return false;
    }
  }
  return true;
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
      const Pose pose = nearest_face(approximation_.to_g(dwell_start_lsb_)).pose;
      refuse(pose, "moved during the reading");
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
          refuse(nearest_face(approximation_.to_g(dwell_start_lsb_)).pose,
                 "moved during the reading");
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
  const NearestFace face = nearest_face(approximation_.to_g(now.mean_lsb));
  if (face.angle_deg > options_.between_faces_deg) {
    refuse(face.pose, fmt::format("lies on none of its six faces: tilted {:.1f} degrees from {}",
                                  face.angle_deg, device::to_string(face.pose)));
    return;
  }
  if (std::find(open_.begin(), open_.end(), face.pose) == open_.end()) {
    refuse(face.pose, fmt::format("{} is done already", device::to_string(face.pose)));
    return;
  }
  dwell_.clear();
  dwell_start_lsb_ = now.mean_lsb;
  state_ = State::dwelling;
}

std::optional<double> JigRun::level_lsb(std::size_t axis, Pose except) const {
  double sum = 0;
  int count = 0;
  for (const PoseReading& face : faces_) {
    if (face.pose != except && device::axis_of(face.pose) != axis) {
      sum += face.mean_lsb[axis];
      ++count;
    }
  }
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}

// Angle by the level axes, against their readings in the other poses.
double JigRun::tilt_of(const PoseReading& reading) const {
  double square = 0;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (axis == device::axis_of(reading.pose)) {
      continue;
    }
    if (const auto level = level_lsb(axis, reading.pose)) {
      const double component_g = (reading.mean_lsb[axis] - *level) * g_per_lsb(axis);
      square += component_g * component_g;
    }
  }
  return std::asin(std::min(1.0, std::sqrt(square))) * kDegPerRad;
}

bool JigRun::repeats_refused(const PoseReading& reading) const {
  if (!last_refused_ || last_refused_->pose != reading.pose) {
    return false;
  }
  constexpr double kSamePlacement_g = 0.01;  // 0.6 degree
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (std::abs(reading.mean_lsb[axis] - last_refused_->mean_lsb[axis]) * g_per_lsb(axis) >
        kSamePlacement_g) {
      return false;
    }
  }
  return true;
}

void JigRun::drop_disagreeing(const PoseReading& reading) {
  const double limit_g = std::sin(options_.tilt_limit_deg / kDegPerRad);
  std::erase_if(faces_, [&](const PoseReading& face) {
    double worst_g = 0;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (axis != device::axis_of(reading.pose) && axis != device::axis_of(face.pose)) {
        worst_g = std::max(
            worst_g, std::abs(face.mean_lsb[axis] - reading.mean_lsb[axis]) * g_per_lsb(axis));
      }
    }
    if (worst_g <= limit_g) {
      return false;
    }
    open_.push_back(face.pose);
    actions_.push_back(
        {JigAction::Kind::dropped, face.pose,
         fmt::format("{} was tilted about {:.1f} degrees, as two placements of {} agree; it is "
                     "needed again",
                     device::to_string(face.pose), std::asin(std::min(1.0, worst_g)) * kDegPerRad,
                     device::to_string(reading.pose))});
    return true;
  });
}

void JigRun::finish_dwell() {
  PoseReading reading;
  reading.pose = nearest_face(approximation_.to_g(dwell_start_lsb_)).pose;
  reading.samples = static_cast<int>(dwell_.size());
  reading.start_s = dwell_.front().time_s;
  const auto n = static_cast<double>(dwell_.size());
  bool clipped = false;
  for (const Sample& sample : dwell_) {
    reading.temperature_c += sample.temperature_c / n;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      reading.mean_lsb[axis] += sample.counts[axis] / n;
      clipped = clipped || sample.counts[axis] <= kRawMin || sample.counts[axis] >= kRawMax;
    }
  }
  for (const Sample& sample : dwell_) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double deviation = sample.counts[axis] - reading.mean_lsb[axis];
      reading.sd_lsb[axis] += deviation * deviation / (n - 1);
    }
  }
  for (double& sd_lsb : reading.sd_lsb) {
    sd_lsb = std::sqrt(sd_lsb);
  }

  if (clipped) {
    refuse(reading.pose, "the sensor is at its limit (clipped)");
    return;
  }
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto first = dwell_.front().counts[axis];
    if (std::all_of(dwell_.begin(), dwell_.end(),
                    [&](const Sample& sample) { return sample.counts[axis] == first; })) {
      refuse(reading.pose, fmt::format("the {} axis does not change at all: the sensor is stuck",
                                       kAxisNames[axis]));
      return;
    }
  }
  reading.tilt_deg = tilt_of(reading);
  if (reading.tilt_deg > options_.tilt_limit_deg) {
    // A placement that repeats itself against a single witness convicts the witness.
    const bool repeats = repeats_refused(reading);
    if (phase_ == JigPhase::measuring && repeats) {
      std::vector<PoseReading> before = faces_;
      drop_disagreeing(reading);
      const bool overruled = before.size() - faces_.size() > 1 && !faces_.empty();
      if (overruled) {  // several agree with each other: it is this one after all
        for (const PoseReading& face : before) {
          std::erase(open_, face.pose);
        }
        faces_ = std::move(before);
        std::erase_if(actions_, [](const JigAction& action) {
          return action.kind == JigAction::Kind::dropped;
        });
        refuse(reading.pose, fmt::format("tilted {:.1f} degrees", reading.tilt_deg));
        return;
      }
      reading.tilt_deg = tilt_of(reading);
    } else {
      last_refused_ = reading;
      refuse(reading.pose, fmt::format("tilted {:.1f} degrees", reading.tilt_deg));
      return;
    }
  }

  last_refused_.reset();
  refusals_in_row_ = 0;
  last_progress_s_ = now_s_;
  std::erase(open_, reading.pose);
  readings_of_phase().push_back(reading);
  actions_.push_back({JigAction::Kind::accepted, reading.pose,
                      fmt::format("{} is taken", device::to_string(reading.pose))});
  leave();
  if (open_.empty()) {
    next_phase();
  } else {
    ask_next();
  }
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
  std::vector<PoseReading>& readings = readings_of_phase();
  if (!readings.empty() && phase_ != JigPhase::writing) {
    const Pose pose = readings.back().pose;
    readings.pop_back();
    open_.insert(open_.begin(), pose);
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

std::vector<JigAction> JigRun::on_unit_gone() {
  if (phase_ != JigPhase::finished) {
    finish(JigOutcome::unit_gone, "the unit is gone");
  }
  return std::exchange(actions_, {});
}

}  // namespace sixpoint::station
