// A line fixed in the laboratory: machines shake the floor.
// Its phase is drawn; it runs on between segments.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind floor_vibration_kind() {
  return effect_kind(
      "floor_vibration", Stage::stimulus,
      "a line fixed in the laboratory: machines shake the floor",
      [](const ParameterSet& values, Random random) {
        return acting_at(&Parts::stimulus, [line = Line(values, random)](SimulatedBlock& block) {
          for (std::size_t i = 0; i < block.size(); ++i) {
            block.motion[i].force_lab_g += line.at(block.time_s[i]);
          }
        });
      },
      {parameter(
           "vector_mg", "mg", {0.7, 0.3, 0.7}, -5, 5,
           "machinery and building modes on a bench: 0.1 to 5 mg, 5 to 30 Hz (peak, per axis)"),
       parameter("frequency_hz", "Hz", {12}, 0.1, 50, "5 to 30 Hz")});
}

}  // namespace sixpoint::sim
