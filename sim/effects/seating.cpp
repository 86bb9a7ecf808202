// The unit sits a little differently every time it is placed.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind seating_kind() {
  return effect_kind(
      "seating", Stage::stimulus, "random orientation error, new at every placement",
      [](const ParameterSet& values, Random random) {
        auto made = std::make_unique<Parts>();
        auto turn = std::make_shared<Eigen::Matrix3d>(Eigen::Matrix3d::Identity());
        made->placement = [turn, sd_deg = values.at("sd_deg")[0],
                           random](const Placement& placement) mutable {
          if (placement.anew) {
            *turn = rotation_by_deg(
                {sd_deg * random.normal(), sd_deg * random.normal(), sd_deg * random.normal()});
          }
        };
        made->stimulus = [turn](SimulatedBlock& block) {
          for (MotionState& motion : block.motion) {
            motion.rotation = *turn * motion.rotation;
          }
        };
        return made;
      },
      {parameter("sd_deg", "deg", {0.1}, 0, 0.5,
                 "standard deviation per axis; a worn nest or a strap: 0.02 to 0.5 degree")});
}

}  // namespace sixpoint::sim
