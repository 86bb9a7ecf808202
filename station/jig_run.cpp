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

FirstApproximation first_approximation(const std::optional<StoredConstants>& stored) {
  if (stored) {
    if (const auto own = calib::calibration_from(*stored)) {
      bool is_possible = true;
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        const double lsb_per_g = 1 / own->sensitivity_g_per_lsb[axis];
        is_possible = is_possible && lsb_per_g >= 150 && lsb_per_g <= 350 &&
                      std::abs(own->zero_lsb[axis]) <= 0.75 * lsb_per_g;
      }
      if (is_possible) {
        return {*own, false};
      }
    }
  }
  constexpr double kNominal_lsb_per_g = 256;
  constexpr double kNominalZero_lsb = 40;  // of the units whose constants are known
  FirstApproximation nominal;
  nominal.calibration.sensitivity_g_per_lsb.fill(1 / kNominal_lsb_per_g);
  nominal.calibration.zero_lsb.fill(kNominalZero_lsb);
  return nominal;
}

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

bool JigRun::is_stuck(const device::RawCounts& counts) {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    repeats_[axis] = counts[axis] == repeated_[axis] ? repeats_[axis] + 1 : 0;
    // At its limit a sensor repeats itself for another reason, which finish_dwell() names.
    if (repeats_[axis] > static_cast<int>(options_.stuck_s * options_.rate_hz) &&
        counts[axis] > kRawMin && counts[axis] < kRawMax) {
      const bool all = std::all_of(repeats_.begin(), repeats_.end(),
                                   [&](int repeats) { return repeats >= repeats_[axis] / 2; });
      finish(JigOutcome::sensor_stuck,
             all ? fmt::format("the sensor is frozen: no axis has changed for {:.0f} s",
                               options_.stuck_s)
                 : fmt::format("the sensor's {} axis is stuck: it has read {} for {:.0f} s",
                               kAxisNames[axis], counts[axis], options_.stuck_s));
      return true;
    }
  }
  repeated_ = counts;
  return false;
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

std::optional<calib::Calibration> JigRun::seen_by_faces() const {
  if (faces_.empty()) {
    return std::nullopt;
  }
  calib::Calibration seen = approximation_;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    // An axis reads its zero where it lies level. One that never did reads it off its face, but for
    // its sensitivity.
    double sum_lsb = 0;
    int count = 0;
    for (const PoseReading& face : faces_) {
      if (device::axis_of(face.pose) == axis) {
        sum_lsb += face.mean_lsb[axis] -
                   device::sign_of(face.pose) / approximation_.sensitivity_g_per_lsb[axis];
        ++count;
      }
    }
    const std::optional<double> level = level_lsb(axis, std::nullopt);
    seen.zero_lsb[axis] = level ? *level : sum_lsb / count;
  }
  return seen;
}

NearestFace JigRun::recognise(const PerAxis<double>& mean_lsb) const {
  std::optional<NearestFace> seen;
  if (const auto constants = seen_by_faces()) {
    seen = nearest_face(constants->to_g(mean_lsb));
    // Two readings that agree leave no doubt about the zeros; one may itself be the tilted one.
    if (seen->angle_deg <= options_.between_faces_deg || faces_.size() > 1) {
      return *seen;
    }
  }
  const NearestFace own = nearest_face(approximation_.to_g(mean_lsb));
  const NearestFace nominal = nearest_face(nominal_.to_g(mean_lsb));
  const bool own_near = own.angle_deg <= options_.between_faces_deg;
  const bool nominal_near = nominal.angle_deg <= options_.between_faces_deg;
  if (own_near && nominal_near && own.pose != nominal.pose) {
    // One of them is wrong: more likely the one that sees what nobody asked for.
    return !open_.empty() && nominal.pose == detour_.value_or(open_.front()) ? nominal : own;
  }
  if (own_near || nominal_near) {
    return own_near ? own : nominal;
  }
  const NearestFace& nearer = own.angle_deg <= nominal.angle_deg ? own : nominal;
  return seen && seen->angle_deg < nearer.angle_deg ? *seen : nearer;
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

std::optional<double> JigRun::level_lsb(std::size_t axis, std::optional<Pose> except) const {
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
  return last_refused_ && last_refused_->pose == reading.pose &&
         same_placement(reading.mean_lsb, last_refused_->mean_lsb);
}

bool JigRun::same_placement(const PerAxis<double>& a_lsb, const PerAxis<double>& b_lsb) const {
  constexpr double kSamePlacement_g = 0.01;  // 0.6 degree
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (std::abs(a_lsb[axis] - b_lsb[axis]) * g_per_lsb(axis) > kSamePlacement_g) {
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
  reading.pose = recognise(dwell_start_lsb_).pose;
  reading.samples = static_cast<int>(dwell_.size());
  reading.start_s = dwell_.front().time_s;
  reading.from = came_from_;
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
  between_faces_lsb_.reset();
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
