// The zero moves linearly in the time since power-on.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind drift_kind() {
  return effect_kind("drift", Stage::sensor, "the zero moves linearly in time",
                     [](const ParameterSet& values, Random) {
                       const Eigen::Vector3d g_per_s =
                           vector_of(values, "mg_per_h") / kMgPerG / 3600;
                       return added_effect([g_per_s](double time_s, double) -> Eigen::Vector3d {
                         return time_s * g_per_s;
                       });
                     },
                     {parameter("mg_per_h", "mg/h", {2, 2, 2}, -5, 5,
                                "a fresh mount or a settling supply: 1 to 5 mg/h")});
}

}  // namespace sixpoint::sim
