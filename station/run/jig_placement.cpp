// How the machine of jig_run.h judges a placement: whether the unit is still, on which face it
// lies, how far it is tilted, and whether the reading may be accepted.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "station/run/jig_run.h"

namespace sixpoint::station {

namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;
// The ends of the ADXL362's 12 bits: a reading there is clipped.
constexpr int kRawMin = -2048;
constexpr int kRawMax = 2047;
// Below half a count rounding hides the noise of a quiet sensor.
constexpr double kLeastNoise_lsb = 0.5;
constexpr double kSamePlacement_g =
    0.01;  // 0.6 degree: a person does not repeat a placement so well
// The mean of the units whose constants are known.
constexpr double kNominal_lsb_per_g = 256;
constexpr double kNominalZero_lsb = 40;
// The table of jig_run.h. A face that is exchanged for another moves two axes by 1 g, or one by
// 2 g: wide bounds tell it, and let a sensor in that is far outside of the limits.
constexpr double kLeastChange_lsb_per_g = kNominal_lsb_per_g / 4;
constexpr double kMostChange_lsb_per_g = kNominal_lsb_per_g * 2;
constexpr double kMostLevelChange_lsb = kNominal_lsb_per_g / 2;
constexpr double kMostFirstZero_g = 1.2;

bool is_clipped(int count) { return count <= kRawMin || count >= kRawMax; }

double degrees_of(double sine) { return std::asin(std::min(1.0, sine)) * kDegPerRad; }

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
    if (const auto own = calib::calibration_from(*stored);
        own && calib::why_no_sensor(*own).empty()) {
      return {*own, false};
    }
  }
  FirstApproximation nominal;
  nominal.calibration.sensitivity_g_per_lsb.fill(1 / kNominal_lsb_per_g);
  nominal.calibration.zero_lsb.fill(kNominalZero_lsb);
  return nominal;
}

double JigRun::to_g(double lsb, std::size_t axis) const {
  return lsb * approximation_.sensitivity_g_per_lsb[axis];
}
double JigRun::to_mg(double lsb, std::size_t axis) const { return to_g(lsb, axis) * kMgPerG; }

bool JigRun::is_still() const {
  const PerAxis<double> sd_lsb = window_.sd_lsb();
  const double factor =
      stillness_ == JigStillness::moving ? options_.still_factor : options_.moved_factor;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const double own_lsb = own_noise_lsb_[axis];
    if (to_mg(sd_lsb[axis], axis) > options_.first_noise_limit_mg ||
        (own_lsb > 0 && sd_lsb[axis] > factor * std::max(own_lsb, kLeastNoise_lsb))) {
      return false;
    }
  }
  return true;
}

bool JigRun::has_moved(const PerAxis<double>& from_lsb, double limit_mg) const {
  const PerAxis<double> mean_lsb = window_.mean_lsb();
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (to_mg(std::abs(mean_lsb[axis] - from_lsb[axis]), axis) > limit_mg) {
      return true;
    }
  }
  return false;
}

bool JigRun::is_stuck(const device::RawCounts& counts) {
  const PerAxis<int>& repeats = window_.repeats();
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    // A clipped sensor repeats itself too; why_unusable() names that.
    if (repeats[axis] <= static_cast<int>(options_.stuck_s * options_.rate_hz) ||
        is_clipped(counts[axis])) {
      continue;
    }
    const bool all = *std::min_element(repeats.begin(), repeats.end()) >= repeats[axis] / 2;
    finish(JigOutcome::sensor_stuck,
           all ? fmt::format("the sensor is frozen: no axis has changed for {:.0f} s",
                             options_.stuck_s)
               : fmt::format("the sensor's {} axis is stuck: it has read {} for {:.0f} s",
                             kAxisNames[axis], counts[axis], options_.stuck_s));
    return true;
  }
  return false;
}

// A turn takes longer, and changes every axis that works.
bool JigRun::may_be_stuck() const {
  constexpr double kTurn_s = 2;
  return std::ranges::max(window_.repeats()) > static_cast<int>(kTurn_s * options_.rate_hz);
}

std::optional<calib::Calibration> JigRun::constants_of_faces() const {
  if (progress_.faces.empty()) {
    return std::nullopt;
  }
  calib::Calibration constants = approximation_;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    // An axis reads its zero where it lies level. One that never lay level gives it from its
    // upright readings and its approximate sensitivity.
    double sum_lsb = 0;
    int count = 0;
    for (const PoseReading& face : progress_.faces) {
      if (device::axis_of(face.pose) == axis) {
        sum_lsb += face.mean_lsb[axis] -
                   device::sign_of(face.pose) / approximation_.sensitivity_g_per_lsb[axis];
        ++count;
      }
    }
    const std::optional<double> level = level_lsb(axis, std::nullopt);
    constants.zero_lsb[axis] = level ? *level : sum_lsb / count;
  }
  return constants;
}

std::optional<Pose> JigRun::asked_face() const {
  if (detour_ || open_.empty()) {
    return detour_;
  }
  return open_.front();
}

// True where the changes from all accepted faces to this reading are those of `pose`, whatever the
// zeros are.
bool JigRun::changes_fit(Pose pose, const PerAxis<double>& mean_lsb) const {
  const PerAxis<double> at_g = device::direction_of(pose);
  for (const PoseReading& face : progress_.faces) {
    const PerAxis<double> from_g = device::direction_of(face.pose);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double turned_g = at_g[axis] - from_g[axis];
      const double change_lsb = mean_lsb[axis] - face.mean_lsb[axis];
      if (turned_g == 0 ? std::abs(change_lsb) > kMostLevelChange_lsb
                        : change_lsb / turned_g < kLeastChange_lsb_per_g ||
                              change_lsb / turned_g > kMostChange_lsb_per_g) {
        return false;
      }
    }
  }
  return !progress_.faces.empty();
}

// The table of jig_run.h.
NearestFace JigRun::recognise(const PerAxis<double>& mean_lsb) const {
  const std::optional<Pose> asked = asked_face();
  if (progress_.faces.empty() && jig_pose_) {
    return {*jig_pose_, 0};
  }
  if (const auto expected = jig_pose_ ? jig_pose_ : asked;
      expected && changes_fit(*expected, mean_lsb)) {
    return {*expected, tilt_of({*expected, mean_lsb})};
  }
  NearestFace nearest = nearest_by_constants(mean_lsb);
  if (progress_.faces.empty() && asked && nearest.angle_deg > options_.between_faces_deg) {
    double square_g2 = 0;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double zero_g =
          mean_lsb[axis] / kNominal_lsb_per_g - device::direction_of(*asked)[axis];
      square_g2 += zero_g * zero_g;
    }
    nearest.pose = std::sqrt(square_g2) <= kMostFirstZero_g ? *asked : nearest.pose;
  }
  return nearest;
}

NearestFace JigRun::nearest_by_constants(const PerAxis<double>& mean_lsb) const {
  std::optional<NearestFace> by_faces;
  if (const auto constants = constants_of_faces()) {
    by_faces = nearest_face(constants->to_g(mean_lsb));
    // Two readings that agree settle the zeros; a single one may itself be tilted.
    if (by_faces->angle_deg <= options_.between_faces_deg || progress_.faces.size() > 1) {
      return *by_faces;
    }
  }
  static const calib::Calibration kNominal = first_approximation(std::nullopt).calibration;
  const NearestFace own = nearest_face(approximation_.to_g(mean_lsb));
  const NearestFace nominal = nearest_face(kNominal.to_g(mean_lsb));
  const bool own_near = own.angle_deg <= options_.between_faces_deg;
  const bool nominal_near = nominal.angle_deg <= options_.between_faces_deg;
  if (own_near && nominal_near && own.pose != nominal.pose) {
    // Most likely the unit lies as it was asked for.
    return nominal.pose == asked_face() ? nominal : own;
  }
  if (own_near || nominal_near) {
    return own_near ? own : nominal;
  }
  const NearestFace& nearer = own.angle_deg <= nominal.angle_deg ? own : nominal;
  return by_faces && by_faces->angle_deg < nearer.angle_deg ? *by_faces : nearer;
}

// Mean reading of an axis in the accepted poses in which it lies level.
std::optional<double> JigRun::level_lsb(std::size_t axis, std::optional<Pose> except) const {
  double sum = 0;
  int count = 0;
  for (const PoseReading& face : progress_.faces) {
    if (face.pose != except && device::axis_of(face.pose) != axis) {
      sum += face.mean_lsb[axis];
      ++count;
    }
  }
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}

// Angle by the level axes, against their readings in the other poses. 0 where there are none.
double JigRun::tilt_of(const PoseReading& reading) const {
  double square = 0;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (axis == device::axis_of(reading.pose)) {
      continue;
    }
    if (const auto level = level_lsb(axis, reading.pose)) {
      const double component_g = to_g(reading.mean_lsb[axis] - *level, axis);
      square += component_g * component_g;
    }
  }
  return degrees_of(std::sqrt(square));
}

bool JigRun::repeats_refused(const PoseReading& reading) const {
  return last_refused_ && last_refused_->pose == reading.pose &&
         same_placement(reading.mean_lsb, last_refused_->mean_lsb);
}

bool JigRun::same_placement(const PerAxis<double>& a_lsb, const PerAxis<double>& b_lsb) const {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (to_g(std::abs(a_lsb[axis] - b_lsb[axis]), axis) > kSamePlacement_g) {
      return false;
    }
  }
  return true;
}

// Takes the faces back that disagree with a repeated reading, unless the reading is the tilted one:
// several faces disagree with it and the midpoints do too. False then, and nothing is changed.
bool JigRun::drop_disagreeing(const PoseReading& reading) {
  const double limit_g = std::sin(options_.tilt_limit_deg / kDegPerRad);
  std::vector<PoseReading> agreeing;
  std::vector<JigAction> dropped;
  for (const PoseReading& face : progress_.faces) {
    double worst_g = 0;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (axis != device::axis_of(reading.pose) && axis != device::axis_of(face.pose)) {
        worst_g =
            std::max(worst_g, to_g(std::abs(face.mean_lsb[axis] - reading.mean_lsb[axis]), axis));
      }
    }
    if (worst_g <= limit_g) {
      agreeing.push_back(face);
      continue;
    }
    dropped.push_back(
        {JigAction::Kind::dropped, face.pose,
         fmt::format("{} was tilted about {:.1f} degrees, as two placements of {} agree; it is "
                     "needed again",
                     device::to_string(face.pose), degrees_of(worst_g),
                     device::to_string(reading.pose))});
  }
  std::swap(progress_.faces, agreeing);
  if (dropped.size() > 1 && !progress_.faces.empty() && !midpoints_agree_with(reading)) {
    std::swap(progress_.faces, agreeing);
    return false;
  }
  for (JigAction& action : dropped) {
    open_.push_back(action.pose);
    actions_.push_back(std::move(action));
  }
  return true;
}

// Midpoint of an axis' readings at +1 g and -1 g: its zero, whatever the tilt of those two
// placements (it acts in second order). None where one of them is missing.
std::optional<double> JigRun::midpoint_lsb(std::size_t axis) const {
  double sum_lsb = 0;
  int count = 0;
  for (const PoseReading& face : progress_.faces) {
    if (device::axis_of(face.pose) == axis) {
      sum_lsb += face.mean_lsb[axis];
      ++count;
    }
  }
  return count == 2 ? std::optional(sum_lsb / 2) : std::nullopt;
}

// True where the midpoints of its level axes confirm the reading.
bool JigRun::midpoints_agree_with(const PoseReading& reading) const {
  const double limit_g = std::sin(options_.tilt_limit_deg / kDegPerRad);
  bool confirmed = false;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto zero_lsb = midpoint_lsb(axis);
    if (axis == device::axis_of(reading.pose) || !zero_lsb) {
      continue;
    }
    if (to_g(std::abs(reading.mean_lsb[axis] - *zero_lsb), axis) > limit_g) {
      return false;
    }
    confirmed = true;
  }
  return confirmed;
}

// Two readings of one pose differ by the seating only, so they show a tilt in the first round that
// the mean of all level readings hides. The newer is asked for again; when it repeats itself, it
// replaces the older one of the first round. True where the reading may be accepted.
bool JigRun::agrees_with_first_round(const PoseReading& reading) {
  const auto first =
      std::find_if(progress_.faces.begin(), progress_.faces.end(),
                   [&](const PoseReading& face) { return face.pose == reading.pose; });
  if (first == progress_.faces.end()) {
    return true;
  }
  double square_g2 = 0;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (axis != device::axis_of(reading.pose)) {
      const double apart_g = to_g(reading.mean_lsb[axis] - first->mean_lsb[axis], axis);
      square_g2 += apart_g * apart_g;
    }
  }
  const double apart_deg = degrees_of(std::sqrt(square_g2));
  if (apart_deg <= options_.tilt_limit_deg) {
    return true;
  }
  if (!repeats_refused(reading)) {
    last_refused_ = reading;
    refuse(reading.pose,
           fmt::format("tilted {:.1f} degrees from how it lay in the first round", apart_deg),
           JigAction::Refusal::tilted);
    return false;
  }
  last_refused_.reset();
  refusals_in_row_ = 0;
  last_progress_s_ = now_s_;
  *first = reading;
  actions_.push_back(
      {JigAction::Kind::dropped, reading.pose,
       fmt::format(
           "{} was tilted about {:.1f} degrees in the first round, as two placements agree; "
           "this one stands for it, and is needed once more from another side",
           device::to_string(reading.pose), apart_deg)});
  actions_.push_back({JigAction::Kind::fit, reading.pose, "the six faces are computed anew"});
  leave();
  ask_next();
  return false;
}

// The unit was still for settle_s: a reading begins, if one is wanted here.
void JigRun::on_settled() {
  const PerAxis<double> mean_lsb = window_.mean_lsb();
  const PerAxis<double> sd_lsb = window_.sd_lsb();
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    double& own_lsb = own_noise_lsb_[axis];
    own_lsb = own_lsb > 0 ? std::min(own_lsb, sd_lsb[axis]) : sd_lsb[axis];
  }
  const NearestFace face = recognise(mean_lsb);
  const bool between = face.angle_deg > options_.between_faces_deg;
  if (between && !(progress_.phase == JigPhase::measuring && between_faces_lsb_ &&
                   same_placement(mean_lsb, *between_faces_lsb_))) {
    between_faces_lsb_ = mean_lsb;
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
  if (const std::string reason = why_not_wanted(face.pose); !reason.empty()) {
    refuse(face.pose, reason,
           may_be_stuck() ? JigAction::Refusal::other : JigAction::Refusal::unwanted);
    return;
  }
  dwell_.clear();
  dwell_start_lsb_ = mean_lsb;
  stillness_ = JigStillness::dwelling;
}

PoseReading JigRun::read_dwell() const {
  PoseReading reading;
  reading.pose = recognise(dwell_start_lsb_).pose;
  reading.samples = static_cast<int>(dwell_.size());
  reading.start_s = dwell_.front().time_s;
  reading.from = came_from_;
  reading.turned_deg = turned_deg();
  const auto n = static_cast<double>(dwell_.size());
  for (const Sample& sample : dwell_) {
    reading.temperature_c += sample.temperature_c / n;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      reading.mean_lsb[axis] += sample.counts[axis] / n;
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
  return reading;
}

// Why the samples of the dwell cannot be a reading; empty when they can.
std::string JigRun::why_unusable() const {
  for (const Sample& sample : dwell_) {
    if (std::any_of(sample.counts.begin(), sample.counts.end(), is_clipped)) {
      return "the sensor is at its limit (clipped)";
    }
  }
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto first = dwell_.front().counts[axis];
    if (std::all_of(dwell_.begin(), dwell_.end(),
                    [&](const Sample& sample) { return sample.counts[axis] == first; })) {
      return fmt::format("the {} axis does not change at all: the sensor is stuck",
                         kAxisNames[axis]);
    }
  }
  return {};
}

// Sets the tilt and refuses the reading where it is too large. A tilt that repeats itself in the
// first round means that the faces before were the tilted ones: they are dropped.
bool JigRun::tilt_is_accepted(PoseReading& reading) {
  reading.tilt_deg = tilt_of(reading);
  if (reading.tilt_deg <= options_.tilt_limit_deg) {
    return true;
  }
  const bool repeated = progress_.phase == JigPhase::measuring && repeats_refused(reading);
  if (repeated && drop_disagreeing(reading)) {
    reading.tilt_deg = tilt_of(reading);
    return true;
  }
  if (!repeated) {
    last_refused_ = reading;
  }
  refuse(reading.pose, fmt::format("tilted {:.1f} degrees", reading.tilt_deg),
         JigAction::Refusal::tilted);
  return false;
}

void JigRun::finish_dwell() {
  PoseReading reading = read_dwell();
  if (const std::string reason = why_unusable(); !reason.empty()) {
    refuse(reading.pose, reason);
    return;
  }
  if (tilt_is_accepted(reading) &&
      (progress_.phase != JigPhase::verifying || agrees_with_first_round(reading))) {
    accept(reading);
  }
}

}  // namespace sixpoint::station
