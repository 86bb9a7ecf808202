// The unit sits a little differently every time it is placed.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Seating final : public Effect {
 public:
  Seating(const ParameterSet& values, Random random)
      : sd_deg_(values.at("sd_deg")[0]), random_(random) {}
  void on_placement(const Placement& placement) override {
    if (placement.anew) {
      turn_ = rotation_by_deg(
          {sd_deg_ * random_.normal(), sd_deg_ * random_.normal(), sd_deg_ * random_.normal()});
    }
  }
  void on_stimulus(SimulatedBlock& block) override {
    for (MotionState& motion : block.motion) {
      motion.rotation = turn_ * motion.rotation;
    }
  }

 private:
  double sd_deg_;
  Random random_;
  Eigen::Matrix3d turn_ = Eigen::Matrix3d::Identity();
};

}  // namespace

EffectKind seating_kind() {
  return {"seating",
          Stage::stimulus,
          "random orientation error, new at every placement",
          {{"sd_deg",
            "deg",
            {0.1},
            0,
            0.5,
            "standard deviation per axis; a worn nest or a strap: 0.02 to 0.5 degree"}},
          [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
            return std::make_unique<Seating>(values, random);
          }};
}

}  // namespace sixpoint::sim
