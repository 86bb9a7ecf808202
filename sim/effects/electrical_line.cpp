// A line fixed in the sensor frame: electrical interference.
// Its phase is drawn; it runs on between segments.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind electrical_line_kind() {
  return effect_kind("electrical_line", Stage::sensor,
                     "a line fixed in the sensor frame: electrical interference",
                     [](const ParameterSet& values, Random random) {
                       return added_effect([line = Line(values, random)](double time_s, double) {
                         return line.at(time_s);
                       });
                     },
                     {parameter("vector_mg", "mg", {0.7, 0.7, 0.7}, -5, 5,
                                "supply ripple and aliased mains: 0.1 to 4 mg (peak, per axis)"),
                      parameter("frequency_hz", "Hz", {17}, 0.1, 50,
                                "mains and their harmonics, aliased below half the sample rate")});
}

}  // namespace sixpoint::sim
