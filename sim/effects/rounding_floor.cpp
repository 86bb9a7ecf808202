// Stored counts are rounded downward instead of to the nearest.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind rounding_floor_kind() {
  return effect_kind("rounding_floor", Stage::digital, "stored counts are rounded downward",
                     [](const ParameterSet&, Random) {
                       return acting_at(&Parts::digital, [](NumberFormat& format) {
                         format.rounding = NumberFormat::Rounding::down;
                       });
                     });
}

}  // namespace sixpoint::sim
