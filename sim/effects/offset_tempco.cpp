// The zero moves with the die's temperature, relative to 25 C.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind offset_tempco_kind() {
  return effect_kind(
      "offset_tempco", Stage::sensor, "the zero moves with temperature",
      [](const ParameterSet& values, Random) {
        const Eigen::Vector3d g_per_c = vector_of(values, "mg_per_c") / kMgPerG;
        return added_effect([g_per_c](double, double temperature_c) -> Eigen::Vector3d {
          return g_per_c * (temperature_c - kReferenceTemperature_c);
        });
      },
      {parameter("mg_per_c", "mg/C", {0.4, 0.4, 0.4}, -1, 1,
                 "ADXL362 datasheet: 0.5 mg/C x and y, 0.6 mg/C z, typical")});
}

}  // namespace sixpoint::sim
