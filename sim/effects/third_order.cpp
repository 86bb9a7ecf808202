// The response is curved: K3 a^3 on every axis.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind third_order_kind() {
  return effect_kind(
      "third_order", Stage::sensor, "third-order nonlinearity, K3 a^3",
      [](const ParameterSet& values, Random) {
        const Eigen::Array3d k3 = vector_of(values, "mg_per_g3").array() / kMgPerG;
        return sensed_effect(
            [k3](Eigen::Vector3d& sensed) { sensed.array() += k3 * sensed.array().cube(); });
      },
      {parameter("mg_per_g3", "mg/g^3", {0.04, 0.04, 0.04}, -0.08, 0.08,
                 "ADXL362 datasheet: nonlinearity 0.5 % of full scale, 40 mg at 8 g")});
}

}  // namespace sixpoint::sim
