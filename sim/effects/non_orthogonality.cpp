// The axes are not at right angles: symmetric cross-axis terms (the antisymmetric part is
// misalignment).
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind non_orthogonality_kind() {
  return effect_kind(
      "non_orthogonality", Stage::sensor, "symmetric cross-axis terms",
      [](const ParameterSet& values, Random) {
        const Eigen::Vector3d term = vector_of(values, "yz_xz_xy");
        Eigen::Matrix3d matrix;
        matrix << 1, term[2], term[1], term[2], 1, term[0], term[1], term[0], 1;
        return sensed_effect([matrix](Eigen::Vector3d& sensed) { sensed = matrix * sensed; });
      },
      {parameter(
          "yz_xz_xy", "1", {0.005, 0.005, 0.005}, -0.03, 0.03,
          "ADXL362 datasheet: 1 %, typical; real units of the family reach 2 to 2.9 % between X "
          "and Y (docs/constants.md)")});
}

}  // namespace sixpoint::sim
