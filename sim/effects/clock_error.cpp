// The sample clock runs fast (positive) or slow: samples come earlier or later than they should.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind clock_error_kind() {
  return effect_kind(
      "clock_error", Stage::sampling, "the sample clock is off; positive runs fast",
      [](const ParameterSet& values, Random) {
        return acting_at(&Parts::sampling,
                         [factor = 1 / (1 + values.at("ppm")[0] * 1e-6)](SimulatedBlock& block) {
                           for (double& time_s : block.time_s) {
                             time_s = block.clock_start_s + (time_s - block.clock_start_s) * factor;
                           }
                         });
      },
      {parameter("ppm", "ppm", {500}, -5000, 5000,
                 "watch crystals 10 to 100 ppm; the ADXL362's own oscillator several thousand")});
}

}  // namespace sixpoint::sim
