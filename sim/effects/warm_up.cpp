// After power-on the zero creeps to its final value: exponential in the time since then.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind warm_up_kind() {
  return effect_kind(
      "warm_up", Stage::sensor, "exponential after power-on",
      [](const ParameterSet& values, Random) {
        return added_effect([g = Eigen::Vector3d(vector_of(values, "mg") / kMgPerG),
                             tau_s = std::max(1e-3, values.at("tau_s")[0])](
                                double time_s, double) -> Eigen::Vector3d {
          return std::exp(-std::max(0.0, time_s) / tau_s) * g;
        });
      },
      {parameter("mg", "mg", {4, 4, 4}, -10, 10,
                 "self-heating by a few degrees times the zero tempco: 1 to 10 mg at power-on"),
       parameter("tau_s", "s", {300}, 30, 1200,
                 "thermal time constant of a small case: 2 to 10 minutes")});
}

}  // namespace sixpoint::sim
