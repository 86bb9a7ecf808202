// The front end clips below full scale.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind saturation_kind() {
  return effect_kind(
      "saturation", Stage::digital, "clips below full scale",
      [](const ParameterSet& values, Random) {
        return sensed_effect(
            [level_g = std::abs(values.at("level_g")[0])](Eigen::Vector3d& sensed) {
              for (double& axis_g : sensed) {
                axis_g = std::clamp(axis_g, -level_g, level_g);
              }
            },
            &Parts::analog);
      },
      {parameter("level_g", "g", {6}, 1, 8, "a wrong range setting or a low supply: 5 to 8 g")});
}

}  // namespace sixpoint::sim
