// Gravity differs from the value that the operator entered.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind local_gravity_kind() {
  return effect_kind(
      "local_gravity", Stage::stimulus, "gravity differs from the reference",
      [](const ParameterSet& values, Random) {
        return motion_effect([more_g = values.at("ratio")[0] - 1](MotionState& motion) {
          motion.force_lab_g.z() += more_g;
        });
      },
      {parameter("ratio", "1", {1.0015}, 0.9973, 1.0026,
                 "9.780 m/s2 at the equator to 9.832 m/s2 at the poles, against 9.80665")});
}

}  // namespace sixpoint::sim
