// Stored counts overflow modulo 4096 instead of clipping.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind wrap_kind() {
  return effect_kind(
      "wrap", Stage::digital, "overflows modulo 4096", [](const ParameterSet&, Random) {
        return acting_at(&Parts::digital, [](NumberFormat& format) { format.wraps = true; });
      });
}

}  // namespace sixpoint::sim
