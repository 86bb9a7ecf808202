#include "gap/explain/forward.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace sixpoint::gap {
namespace {

constexpr int kPhases = 24;            // exact for polynomials of third order and their projections
constexpr int kPhasesTruncated = 720;  // the step about zero is some LSB wide in a swing of 256
constexpr double kRadPerDeg = M_PI / 180;
constexpr double kLeastNoise_lsb = 0.3;  // rounding alone scatters by 1 / sqrt(12) LSB
constexpr double kLeastStep_g = 0.05;
constexpr int kFirstEffect = 6;  // parameter; gains and offsets stand before it

Eigen::Matrix3d turn(const Eigen::Vector3d& vector_deg) {
  const double angle = vector_deg.norm() * kRadPerDeg;
  return angle == 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                    : Eigen::AngleAxisd(angle, vector_deg.normalized()).toRotationMatrix();
}

// cos p, cos 2p and cos 3p over half a period.
const std::array<std::array<double, 3>, kPhasesTruncated / 2 + 1>& cosines() {
  static const auto kTable = [] {
    std::array<std::array<double, 3>, kPhasesTruncated / 2 + 1> table{};
    for (std::size_t k = 0; k < table.size(); ++k) {
      for (std::size_t h = 0; h < 3; ++h) {
        table[k][h] = std::cos(2 * M_PI * static_cast<double>((h + 1) * k) / kPhasesTruncated);
      }
    }
    return table;
  }();
  return kTable;
}

// Phases that a truncated swing needs; `swing` in standard deviations of the noise. Its harmonics
// fall as exp(-(k / swing)^2 / 2).
int phases_of(double swing) {
  for (const int phases : {kPhases, 48, 72, 144, 240}) {
    if (phases > 8 * std::abs(swing)) {
      return phases;
    }
  }
  return kPhasesTruncated;
}

// erf to 1e-11, by cubic interpolation with its derivative. std::erf would take most of the time of
// a diagnosis with truncation.
double quick_erf(double x) {
  constexpr int kPerUnit = 256;
  constexpr double kEnd = 5;
  struct Knot {
    double value, slope;  // per knot's distance
  };
  static const std::vector<Knot> kKnots = [] {
    std::vector<Knot> knots;
    for (int i = 0; i <= static_cast<int>(kEnd) * kPerUnit + 1; ++i) {
      const double at = static_cast<double>(i) / kPerUnit;
      knots.push_back({std::erf(at), M_2_SQRTPI * std::exp(-at * at) / kPerUnit});
    }
    return knots;
  }();
  const double size = std::abs(x);
  if (!(size < kEnd)) {
    return std::copysign(1.0, x);  // to 2e-12
  }
  const double scaled = size * kPerUnit;
  const auto i = static_cast<std::size_t>(scaled);
  const double t = scaled - static_cast<double>(i);
  const Knot& a = kKnots[i];
  const Knot& b = kKnots[i + 1];
  const double rise = b.value - a.value;
  const double value =
      a.value +
      t * (a.slope + t * (3 * rise - 2 * a.slope - b.slope + t * (a.slope + b.slope - 2 * rise)));
  return std::copysign(value, x);
}

// Size of an effect that a unit has a little of, as a share of the typical (convention: from the
// datasheet's typical values to what the best units have).
constexpr double kSmallShare = 0.2;
// Of one that a long recording just shows: as much below that.
constexpr double kFaintShare = kSmallShare * kSmallShare;
// Of one that is far beyond the catalogue's sizes.
constexpr double kLargeShare = 4;

// Gains and offsets are free, truncation is there or not, and gravity is known within one range.
bool varies_in_size(const ParameterGroup& group) {
  return group.effect != "gain" && group.effect != "offset" && group.effect != "truncation" &&
         group.effect != "local_gravity";
}

// Gains and offsets are free, and truncation has no size.
bool can_be_learnt(const ParameterGroup& group, const LearntSize& size) {
  const auto numbers = static_cast<std::size_t>(std::min(3, group.count));
  return group.first >= kFirstEffect && group.effect != "truncation" &&
         size.mean.size() == numbers && size.sd.size() == numbers;
}

// Steps below kLeastStep_g are none.
double sign_of_step(double step_g) {
  return std::abs(step_g) < kLeastStep_g ? 0 : std::copysign(1.0, step_g);
}

// What temperature, time and hysteresis add to the zero.
Eigen::Vector3d slow_zero_mg(const ForwardState& s, const Block& block) {
  const double warm = block.temperature_c - kReference_c;
  const double hours = block.middle_s / 3600;
  // Mean over the block of exp(-t / tau), and of 1 before power-on, as sim/ has it. Its ends are taken
  // apart: of a block of many tau the sinh of half its length overflows.
  const auto decay = [&](double tau_s) {
    const double from_s = std::max(0.0, block.middle_s - block.seconds / 2);
    const double to_s = std::max(0.0, block.middle_s + block.seconds / 2);
    const double start = std::exp(-from_s / tau_s);
    if (!(block.seconds > 0)) {
      return start;
    }
    const double before_s = block.seconds - (to_s - from_s);
    return (before_s - tau_s * start * std::expm1((from_s - to_s) / tau_s)) / block.seconds;
  };
  Eigen::Vector3d slow_mg = warm * s.tempco_mg_per_c + warm * warm * s.tempco_curve_mg_per_c2 +
                            warm * warm * warm * s.tempco_cubic_mg_per_c3 +
                            hours * s.drift_mg_per_h + decay(s.warm_up_tau_s) * s.warm_up_mg;
  // Zero in most calls, and both cost.
  if (!s.quick_warm_up_mg.isZero(0)) {
    slow_mg += decay(s.warm_up_tau_s / 4) * s.quick_warm_up_mg;
  }
  if (!s.drift_ripple_mg_per_h.isZero(0)) {
    slow_mg += s.drift_ripple_mg_per_h * block.ripple_h;
  }
  for (Eigen::Index a = 0; a < 3; ++a) {
    slow_mg[a] += s.hysteresis_mg[a] * (s.hysteresis_shape == 0 ? 0.5 * block.approach_g[a]
                                        : s.hysteresis_shape == 1
                                            ? sign_of_step(block.approach_g[a])
                                            : block.held_sign(a, s.hysteresis_shape - 2));
  }
  return slow_mg;
}

template <class... Vectors>
auto spans_of(Vectors&... vectors) {
  return std::array{std::span<double>(vectors.data(), static_cast<std::size_t>(vectors.size()))...};
}

}  // namespace

double& parameter(ForwardState& s, int position) {
  auto at = static_cast<std::size_t>(position);
  for (const std::span<double> values :
       spans_of(s.gain, s.offset_mg, s.tilt_deg, s.misalignment_deg, s.cross, s.second_mg_per_g2,
                s.third_mg_per_g3, s.hysteresis_mg, s.tempco_mg_per_c, s.tempco_curve_mg_per_c2,
                s.tempco_cubic_mg_per_c3, s.sensitivity_percent_per_c,
                s.sensitivity_curve_percent_per_c2, s.sensitivity_cubic_percent_per_c3,
                s.warm_up_mg, s.quick_warm_up_mg, s.drift_mg_per_h, s.drift_ripple_mg_per_h)) {
    if (at < values.size()) {
      return values[at];
    }
    at -= values.size();
  }
  return at == 0 ? s.gravity_ratio : s.truncation;
}

double parameter(const ForwardState& state, int position) {
  ForwardState copy = state;
  return parameter(copy, position);
}

double absent_value(const std::string& effect) { return effect == "local_gravity" ? 1 : 0; }

std::vector<ParameterGroup> parameter_groups(const std::vector<LearntSize>& learnt) {
  // Nuisances are free here (sd of 0.3): their own priors, 2 % and 35 mg, are judged afterwards.
  // Effects: prior sd about the middle of the catalogue's realistic sizes, `largest` their upper
  // end, `smallest` their lower (where the catalogue names none: a third of the typical).
  // A zero bends over temperature by some hundredths of its slope per degree, and by a tenth of its
  // slope over 20 C as a cubic; a sensitivity bends by a tenth over 20 C, either way. A drift
  // ripples by a tenth of all that it drifts, from crest to trough.
  std::vector<ParameterGroup> groups = {
      {"gain", 0, 3, 0.3, 1, 0, 10},
      {"offset", 3, 3, 300, 0, 0, 1e4},
      {"tilt", 6, 2, 0.2, 0, 0, 0.5, 0.05},
      {"misalignment", 8, 3, 0.4, 0, 0, 1, 0.1},
      {"non_orthogonality", 11, 3, 0.006, 0, 0, 0.015, 0.0015},
      {"second_order", 14, 3, 0.35, 0, 0, 0.6, 0.12},
      {"third_order", 17, 3, 0.05, 0, 0, 0.08, 0.012},
      {"offset_tempco", 23, 9, 0.5, 0, 0.004, 1, 0.2, 0, 1, kBend * 0.5 / (kBend_c * kBend_c)},
      {"sensitivity_tempco", 32, 9, 0.03, 0, kBend * 0.03 / kBend_c, 0.05, 0.01, 0, 1,
       kBend * 0.03 / (kBend_c * kBend_c)},
      {"drift", 47, 3 + 3 * kRipples, 2.5, 0, kRippleShare * 2.5, 5, 1, 0, 1, kRippleShare * 2.5},
      {"local_gravity", 68, 1, 0.0015, 0, 0, 0.0027, 0.0005},
      {"truncation", 69, 1, 0.05, 1, 0, 0.35},
  };
  static_assert(kLeastSteps_g.size() == 4);  // shapes 2 to 5
  for (const int shape : {1, 0, 2, 3, 4, 5}) {
    groups.push_back({"hysteresis", 20, 3, 1, 0, 0, 2, 0.2, 0, shape});
  }
  for (const double tau_s : {75.0, 120.0, 180.0, 270.0, 400.0, 600.0}) {
    groups.push_back({"warm_up", 41, 6, 4, 0, kBend * 4, 10, 1, tau_s, 1});
  }
  // A prior of one width would count a small size as unlikely: 1.6 nats for each number of it. How
  // much an effect bends goes with its size.
  const std::size_t full = groups.size();
  for (const double share : {kSmallShare, kFaintShare, kLargeShare}) {
    for (std::size_t i = 0; i < full; ++i) {
      if (varies_in_size(groups[i]) && (share < 1 || groups[i].curve_sd > 0)) {
        groups.push_back(groups[i]);
        groups.back().prior_sd *= share;
        groups.back().curve_sd *= share;
        groups.back().cubic_sd *= share;
        groups.back().faint = share == kFaintShare;
      }
    }
  }
  for (const LearntSize& size : learnt) {
    for (std::size_t i = 0; i < full; ++i) {
      if (groups[i].effect == size.effect && can_be_learnt(groups[i], size)) {
        groups.push_back(groups[i]);
        groups.back().learnt = size;
      }
    }
  }
  return groups;
}

void set_ripples(std::vector<Block>& blocks) {
  if (blocks.empty()) {
    return;
  }
  const double start_s = blocks.front().middle_s;
  const double span_s = blocks.back().middle_s - start_s;
  for (Block& block : blocks) {
    const double turns = span_s > 0 ? (block.middle_s - start_s) / span_s : 0;
    for (int k = 0; k < kRipples; ++k) {
      const int periods = k / 2 + 1;
      const double angle = 2 * M_PI * periods * turns;
      block.ripple_h[k] = span_s / 3600 * (k % 2 == 0 ? std::sin(angle) : std::cos(angle));
    }
  }
}

double truncated_mg(double stored_mg, double noise_mg, double lsb_mg) {
  constexpr double kOneMean_lsb = 0.4;  // with less noise several means are stored alike
  const double sigma = std::max(kOneMean_lsb * lsb_mg, noise_mg);
  double least = 0;  // halved, until no double is between
  double most = lsb_mg / 2;
  const double stored = std::abs(stored_mg);
  for (int halving = 0; halving < 50; ++halving) {
    const double taken = (least + most) / 2;
    (taken < lsb_mg / 2 * std::erf((stored + taken) / (sigma * M_SQRT2)) ? least : most) = taken;
  }
  return std::copysign(least, stored_mg);
}

Eigen::VectorXd predict(const ForwardState& s, const Block& block, double lsb_mg) {
  const Eigen::Matrix3d tilt = turn(Eigen::Vector3d(s.tilt_deg[0], s.tilt_deg[1], 0));
  Eigen::Matrix3d cross;
  cross << 1, s.cross[2], s.cross[1], s.cross[2], 1, s.cross[0], s.cross[1], s.cross[0], 1;
  const Eigen::Matrix3d chain = cross * turn(s.misalignment_deg) * block.rotation * tilt;
  const Eigen::Vector3d rest = chain * (block.gravity_lab_g * (1 + s.gravity_ratio));
  const Eigen::Vector3d swing = chain * block.vibration_lab_g;
  const Eigen::Vector3d slow_mg = slow_zero_mg(s, block);
  const double warm = block.temperature_c - kReference_c;
  const Eigen::Vector3d sensitivity =
      Eigen::Vector3d::Ones() + 0.01 * warm * s.sensitivity_percent_per_c +
      0.01 * warm * warm * s.sensitivity_curve_percent_per_c2 +
      0.01 * warm * warm * warm * s.sensitivity_cubic_percent_per_c3;
  // What axis a makes of the specific force v.
  const auto sensed_mg = [&](Eigen::Index a, double v) {
    const double y = (1000 * v + s.second_mg_per_g2[a] * v * v + s.third_mg_per_g3[a] * v * v * v) *
                         sensitivity[a] +
                     slow_mg[a];
    return y * s.gain[a] + s.offset_mg[a];
  };
  // The mean of that over a swing.
  const auto mean_mg = [&](Eigen::Index a) {
    const double curved_mg =
        (0.5 * s.second_mg_per_g2[a] + 1.5 * s.third_mg_per_g3[a] * rest[a]) * swing[a] * swing[a];
    return sensed_mg(a, rest[a]) + curved_mg * sensitivity[a] * s.gain[a];
  };
  // What is stored of it in a noise of sigma.
  const auto stored_mg = [&](double y, double sigma) {
    return s.truncation == 0 ? y
                             : y - s.truncation * 0.5 * lsb_mg * quick_erf(y / (sigma * M_SQRT2));
  };

  Eigen::VectorXd out = Eigen::VectorXd::Zero(block.size());
  for (Eigen::Index a = 0; a < 3; ++a) {
    if (!block.tone) {
      out[a] = sensed_mg(a, rest[a]) - s.truncation * block.truncated_mg[a];
      continue;
    }
    const double sigma = std::max(kLeastNoise_lsb * lsb_mg, block.noise_mg[a]);
    const double filter = block.filter_gain;
    const double level_mg = mean_mg(a);
    const int phases =
        s.truncation == 0 ? kPhases : phases_of(1000 * filter * s.gain[a] * swing[a] / sigma);
    const auto stride = static_cast<std::size_t>(kPhasesTruncated / phases);
    // The second half of a period is the first, mirrored.
    for (int k = 0; k <= phases / 2; ++k) {
      const std::array<double, 3>& cosine = cosines()[static_cast<std::size_t>(k) * stride];
      const double share = (k == 0 || 2 * k == phases ? 1.0 : 2.0) / phases;
      const double sensed = sensed_mg(a, rest[a] + cosine[0] * swing[a]);
      const double y = stored_mg(level_mg + filter * (sensed - level_mg), sigma);
      out[a] += y * share;
      out[kToneAmplitude + a] += 2 * y * cosine[0] * share;
      if (block.harmonics && a == block.axis) {
        out[kSecondHarmonic] += 2 * y * cosine[1] * share;
        out[kThirdHarmonic] += 2 * y * cosine[2] * share;
      }
    }
  }
  if (block.tone && swing[block.axis] < 0) {
    // In phase with the axis that is moved most: its amplitude is positive by definition.
    out.segment<3>(kToneAmplitude) *= -1;
    if (block.harmonics) {
      out[kThirdHarmonic] *= -1;
    }
  }
  return out;
}

Eigen::MatrixXd seating_lever(const Block& block) {
  Eigen::MatrixXd lever = Eigen::MatrixXd::Zero(block.size(), 3);
  const Eigen::Vector3d rest = block.rotation * block.gravity_lab_g;
  const Eigen::Vector3d swing = block.rotation * block.vibration_lab_g;
  const double sign = block.tone && swing[block.axis] < 0 ? -1 : 1;
  for (Eigen::Index k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k) * (1000 * kRadPerDeg);
    lever.block<3, 1>(0, k) = axis.cross(rest);
    if (block.tone) {
      lever.block<3, 1>(3, k) = sign * block.filter_gain * axis.cross(swing);
    }
  }
  return lever;
}

Eigen::VectorXd seating_loss(const Block& block) {
  Eigen::VectorXd loss = Eigen::VectorXd::Zero(block.size());
  loss.head<3>() = 500 * block.rotation * block.gravity_lab_g;
  if (block.tone) {
    const Eigen::Vector3d swing = block.rotation * block.vibration_lab_g;
    loss.segment<3>(kToneAmplitude) =
        std::copysign(500.0 * block.filter_gain, swing[block.axis]) * swing;
  }
  return loss;
}

}  // namespace sixpoint::gap
