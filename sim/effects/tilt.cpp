// The jig's base is out of level, so every pose is turned by the same small angle in the
// laboratory's frame.
//
// T turns what acts on the unit, seen from the base: specific force f in the laboratory becomes
// T f. The base itself is turned by the inverse.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind tilt_kind() {
  return effect_kind(
      "tilt", Stage::stimulus, "jig base out of level, fixed in the laboratory's frame",
      [](const ParameterSet& values, Random) {
        Eigen::Vector3d vector_deg = vector_of(values, "rotation_vector_deg");
        const double angle_deg = values.at("angle_deg")[0];
        if (angle_deg > 0 && vector_deg.norm() > 0) {
          vector_deg *= angle_deg / vector_deg.norm();
        }
        const Eigen::Matrix3d turn = rotation_by_deg({vector_deg[0], vector_deg[1], vector_deg[2]});
        return motion_effect(
            [turn](MotionState& motion) { motion.rotation = motion.rotation * turn; });
      },
      {rotation_parameter(0.2, 0.5,
                          "a machinist's level on a laboratory bench: 0.05 to 0.5 degree"),
       parameter("angle_deg", "deg", {0}, 0, 5,
                 "0 = the length of the vector; else the vector says the direction only")});
}

}  // namespace sixpoint::sim
