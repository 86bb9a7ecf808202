// Sample times scatter, each by itself.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind jitter_kind() {
  return effect_kind("jitter", Stage::sampling, "sample times scatter",
                     [](const ParameterSet& values, Random random) {
                       return acting_at(&Parts::sampling, [rms_s = values.at("rms_ms")[0] / 1000,
                                                           random](SimulatedBlock& block) mutable {
                         for (double& time_s : block.time_s) {
                           time_s += rms_s * random.normal();
                         }
                       });
                     },
                     {parameter("rms_ms", "ms", {0.7}, 0, 5,
                                "interrupt latency of a small processor: 0.1 to 2 ms")});
}

}  // namespace sixpoint::sim
