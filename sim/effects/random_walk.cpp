// The zero walks: 1/f^2 noise. It walks on between segments.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind random_walk_kind() {
  return effect_kind(
      "random_walk", Stage::sensor, "1/f^2 noise: the zero walks",
      [](const ParameterSet& values, Random random) {
        struct Walk {
          double last_s = 0;
          Eigen::Vector3d at_g = Eigen::Vector3d::Zero();
        };
        return added_effect([g_per_sqrt_s = values.at("mg_per_sqrt_s")[0] / kMgPerG, random,
                             walk = Walk()](double time_s, double) mutable {
          const double step = g_per_sqrt_s * std::sqrt(std::max(0.0, time_s - walk.last_s));
          walk.last_s = std::max(walk.last_s, time_s);
          for (double& axis_g : walk.at_g) {
            axis_g += step * random.normal();
          }
          return walk.at_g;
        });
      },
      {parameter("mg_per_sqrt_s", "mg/sqrt(s)", {0.2}, 0, 1,
                 "0.1 to 0.3 mg after a second, growing with the square root of time")});
}

}  // namespace sixpoint::sim
