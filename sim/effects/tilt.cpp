// The jig's base is out of level, so every pose is turned by the same small angle in the
// laboratory's frame.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Tilt final : public Effect {
 public:
  explicit Tilt(const ParameterSet& values)
      : turn_(rotation_by_deg(values.at("rotation_vector_deg"))) {}
  // The base, and the unit with it, is turned by T in the laboratory; what maps the laboratory to
  // the sensor gets the inverse on its right.
  void on_stimulus(SimulatedBlock& block) override {
    for (MotionState& motion : block.motion) {
      motion.rotation = motion.rotation * turn_.transpose();
    }
  }

 private:
  Eigen::Matrix3d turn_;
};

}  // namespace

EffectKind tilt_kind() {
  return {"tilt",
          Stage::stimulus,
          "jig base out of level, fixed in the laboratory's frame",
          {{"rotation_vector_deg",
            "deg",
            {0.2, 0, 0},
            -0.5,
            0.5,
            "a machinist's level on a laboratory bench: 0.05 to 0.5 degree"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<Tilt>(values);
          }};
}

}  // namespace sixpoint::sim
