// The sensor's axes are rotated in the case: T turns the case's components into the sensor's, so
// the axes themselves are turned by the inverse.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Misalignment final : public Effect {
 public:
  explicit Misalignment(const ParameterSet& values)
      : turn_(rotation_by_deg(values.at("rotation_vector_deg"))) {}
  void on_sensor(SimulatedBlock& block) override {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      sensed = turn_ * sensed;
    }
  }

 private:
  Eigen::Matrix3d turn_;
};

}  // namespace

EffectKind misalignment_kind() {
  return {"misalignment",
          Stage::sensor,
          "the sensor's axes rotated in the case",
          {{"rotation_vector_deg",
            "deg",
            {0.5, 0, 0},
            -1,
            1,
            "soldering and case tolerances: 0.1 to 1 degree"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<Misalignment>(values);
          }};
}

}  // namespace sixpoint::sim
