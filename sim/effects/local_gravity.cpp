// Gravity differs from the one that the operator believes.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class LocalGravity final : public Effect {
 public:
  explicit LocalGravity(const ParameterSet& values) : more_g_(values.at("ratio")[0] - 1) {}
  void on_stimulus(SimulatedBlock& block) override {
    for (MotionState& motion : block.motion) {
      motion.force_lab_g.z() += more_g_;
    }
  }

 private:
  double more_g_;
};

}  // namespace

EffectKind local_gravity_kind() {
  return {"local_gravity",
          Stage::stimulus,
          "gravity differs from the reference",
          {{"ratio",
            "1",
            {1.0015},
            0.9973,
            1.0026,
            "9.780 m/s2 at the equator to 9.832 m/s2 at the poles, against 9.80665"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<LocalGravity>(values);
          }};
}

}  // namespace sixpoint::sim
