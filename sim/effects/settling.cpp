// After a change of pose the mount rings, as a share of the step in specific force, and dies away.
// Mounts have more than one mode: a second one, quicker and shorter, can be given a share.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Settling final : public Effect {
 public:
  explicit Settling(const ParameterSet& values)
      : amplitude_(values.at("amplitude")[0]),
        omega_(2 * std::numbers::pi * values.at("frequency_hz")[0]),
        decay_s_(std::max(1e-3, values.at("decay_s")[0])),
        second_share_(values.at("second_share")[0]),
        second_ratio_(values.at("second_ratio")[0]) {}
  void on_placement(const Placement& placement) override {
    if (placement.contiguous) {
      return;
    }
    start_s_ = placement.start_s;
    step_g_ = (placement.previous - placement.rotation) * Eigen::Vector3d::UnitZ() * amplitude_;
    rings_ = step_g_.norm() > 1e-9;
  }
  void on_stimulus(SimulatedBlock& block) override {
    constexpr double kOver = 20;  // time constants
    for (std::size_t i = 0; rings_ && i < block.size(); ++i) {
      const double since_s = block.time_s[i] - start_s_;
      if (since_s < 0) {
        continue;
      }
      if (since_s > kOver * decay_s_) {
        rings_ = false;
        return;
      }
      const double decayed = since_s / decay_s_;
      double ring = (1 - second_share_) * std::exp(-decayed) * std::cos(omega_ * since_s);
      if (second_share_ != 0) {
        ring += second_share_ * std::exp(-decayed * kSecondDecay) *
                std::cos(omega_ * second_ratio_ * since_s);
      }
      MotionState& motion = block.motion[i];
      motion.force_lab_g += motion.rotation.transpose() * (ring * step_g_);
    }
  }

 private:
  static constexpr double kSecondDecay = 1.5;  // the higher mode dies away sooner
  double amplitude_;
  double omega_;
  double decay_s_;
  double second_share_;
  double second_ratio_;
  double start_s_ = 0;
  Eigen::Vector3d step_g_ = Eigen::Vector3d::Zero();
  bool rings_ = false;
};

}  // namespace

EffectKind settling_kind() {
  return effect_kind(
      "settling", Stage::stimulus, "ringing after a change of pose, decaying",
      make_effect<Settling>,
      {parameter("amplitude", "1", {0.03}, 0, 0.2,
                 "share of the step; elastic mounts overshoot by 1 to 5 %"),
       parameter("frequency_hz", "Hz", {6}, 0.5, 25,
                 "first mode of a jig arm with a 20 g unit: 3 to 12 Hz"),
       parameter("decay_s", "s", {0.4}, 0.02, 2,
                 "time constant at 5 % of critical damping: 0.2 to 0.6 s"),
       parameter("second_share", "1", {0}, 0, 0.5, "share of the second mode in the amplitude"),
       parameter("second_ratio", "1", {2}, 1.1, 6.3,
                 "its frequency over the first; 6.27 for a cantilever")});
}

}  // namespace sixpoint::sim
