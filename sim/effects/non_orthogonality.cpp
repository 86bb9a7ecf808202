// The axes are not at right angles: symmetric cross-axis terms (the antisymmetric part is
// misalignment).
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class NonOrthogonality final : public Effect {
 public:
  explicit NonOrthogonality(const ParameterSet& values) {
    const Eigen::Vector3d term = vector_of(values, "yz_xz_xy");
    matrix_ << 1, term[2], term[1], term[2], 1, term[0], term[1], term[0], 1;
  }
  void on_sensor(SimulatedBlock& block) override {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      sensed = matrix_ * sensed;
    }
  }

 private:
  Eigen::Matrix3d matrix_;
};

}  // namespace

EffectKind non_orthogonality_kind() {
  return {"non_orthogonality",
          Stage::sensor,
          "symmetric cross-axis terms",
          {{"yz_xz_xy",
            "1",
            {0.005, 0.005, 0.005},
            -0.03,
            0.03,
            "ADXL362 datasheet: 1 %, typical; real units of the family reach 2 to 2.9 % between X "
            "and Y (docs/constants.md)"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<NonOrthogonality>(values);
          }};
}

}  // namespace sixpoint::sim
