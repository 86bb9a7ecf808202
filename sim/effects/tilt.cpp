// The jig's base is out of level, so every pose is turned by the same small angle in the
// laboratory's frame.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Tilt final : public Effect {
 public:
  explicit Tilt(const ParameterSet& values) {
    Eigen::Vector3d vector_deg = vector_of(values, "rotation_vector_deg");
    const double angle_deg = values.at("angle_deg")[0];
    if (angle_deg > 0 && vector_deg.norm() > 0) {
      vector_deg *= angle_deg / vector_deg.norm();
    }
    turn_ = rotation_by_deg({vector_deg[0], vector_deg[1], vector_deg[2]});
  }
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
            "a machinist's level on a laboratory bench: 0.05 to 0.5 degree"},
           {"angle_deg",
            "deg",
            {0},
            0,
            5,
            "0 = the length of the vector; else the vector says the direction only"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<Tilt>(values);
          }};
}

}  // namespace sixpoint::sim
