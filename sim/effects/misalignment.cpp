// The sensor's axes are rotated in the case: T turns the case's components into the sensor's, so
// the axes themselves are turned by the inverse.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind misalignment_kind() {
  return effect_kind(
      "misalignment", Stage::sensor, "the sensor's axes rotated in the case",
      [](const ParameterSet& values, Random) {
        return sensed_effect([turn = rotation_by_deg(values.at("rotation_vector_deg"))](
                                 Eigen::Vector3d& sensed) { sensed = turn * sensed; });
      },
      {rotation_parameter(0.5, 1, "soldering and case tolerances: 0.1 to 1 degree")});
}

}  // namespace sixpoint::sim
