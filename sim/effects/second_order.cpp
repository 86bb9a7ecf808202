// The sensor's response is curved: K2 a^2 on every axis.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind second_order_kind() {
  return effect_kind(
      "second_order", Stage::sensor, "second-order nonlinearity, K2 a^2",
      [](const ParameterSet& values, Random) {
        const Eigen::Array3d k2 = vector_of(values, "mg_per_g2").array() / kMgPerG;
        return sensed_effect([k2](Eigen::Vector3d& sensed) {
          sensed.array() += k2 * sensed.array() * sensed.array();
        });
      },
      {parameter("mg_per_g2", "mg/g^2", {0.3, 0.3, 0.3}, -0.6, 0.6,
                 "ADXL362 datasheet: nonlinearity 0.5 % of full scale, mostly of higher order")});
}

}  // namespace sixpoint::sim
