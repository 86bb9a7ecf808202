// How the machine of jig_run.h judges a placement: whether the unit is still, on which face it
// lies, how far it is tilted, and whether what was read there may be taken.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "station/jig_run.h"

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

// An axis' readings at +1 g and -1 g have its zero in their midpoint, whatever the tilt of those
// two placements (it acts in second order). Does that speak for this reading, against the level
// ones?
bool JigRun::midpoints_agree_with(const PoseReading& reading) const {
  const double limit_g = std::sin(options_.tilt_limit_deg / kDegPerRad);
  bool supported = false;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    double sum_lsb = 0;
    int count = 0;
    for (const PoseReading& face : faces_) {
      if (device::axis_of(face.pose) == axis) {
        sum_lsb += face.mean_lsb[axis];
        ++count;
      }
    }
    if (axis != device::axis_of(reading.pose) && count == 2 &&
        std::abs(reading.mean_lsb[axis] - sum_lsb / 2) * g_per_lsb(axis) > limit_g) {
      return false;
    }
    supported = supported || (axis != device::axis_of(reading.pose) && count == 2);
  }
  return supported;
}

// Two readings of one pose differ by how the unit was seated, and by nothing of the sensor's own:
// where one of them was tilted they say so even when the mean of all level readings does not, into
// which a tilted one went itself. The newer is asked for again; when it repeats itself, the older
// one of the first round goes, and the newer stands for it.
bool JigRun::agrees_with_first_round(const PoseReading& reading) {
  const auto first = std::find_if(faces_.begin(), faces_.end(), [&](const PoseReading& face) {
    return face.pose == reading.pose;
  });
  if (first == faces_.end()) {
    return true;
  }
  double square_g2 = 0;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    if (axis != device::axis_of(reading.pose)) {
      const double apart_g = (reading.mean_lsb[axis] - first->mean_lsb[axis]) * g_per_lsb(axis);
      square_g2 += apart_g * apart_g;
    }
  }
  const double apart_deg = std::asin(std::min(1.0, std::sqrt(square_g2))) * kDegPerRad;
  if (apart_deg <= options_.tilt_limit_deg) {
    return true;
  }
  if (!repeats_refused(reading)) {
    last_refused_ = reading;
    refuse(reading.pose,
           fmt::format("tilted {:.1f} degrees from how it lay in the first round", apart_deg));
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
      const bool overruled =
          before.size() - faces_.size() > 1 && !faces_.empty() && !midpoints_agree_with(reading);
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

  if (phase_ == JigPhase::verifying && !agrees_with_first_round(reading)) {
    return;
  }

  if (last_refused_ && last_refused_->pose == reading.pose) {
    last_refused_.reset();  // another pose's may come again, and is then a repeat
  }
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

}  // namespace sixpoint::station
