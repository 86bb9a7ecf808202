// The sensitivity moves with the temperature of the die, relative to 25 C.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind sensitivity_tempco_kind() {
  return effect_kind("sensitivity_tempco", Stage::sensor, "the sensitivity moves with temperature",
                     [](const ParameterSet& values, Random) {
                       const Eigen::Array3d per_c =
                           vector_of(values, "percent_per_c").array() / 100;
                       return acting_at(&Parts::sensor, [per_c](SimulatedBlock& block) {
                         for (std::size_t i = 0; i < block.size(); ++i) {
                           block.sensed_g[i].array() *=
                               1 + per_c * (block.temperature_c[i] - kReferenceTemperature_c);
                         }
                       });
                     },
                     {parameter("percent_per_c", "%/C", {0.03, 0.03, 0.03}, -0.05, 0.05,
                                "ADXL362 datasheet: 0.05 %/C, typical")});
}

}  // namespace sixpoint::sim
