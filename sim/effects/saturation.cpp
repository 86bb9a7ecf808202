// The sensor clips below full scale: behind its gain and zero, so that all units pile up at one count.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind saturation_kind() {
  return effect_kind(
      "saturation", Stage::digital, "clips below full scale",
      [](const ParameterSet& values, Random) {
        return acting_at(&Parts::digital,
                         [level_g = std::abs(values.at("level_g")[0])](NumberFormat& format) {
                           format.limit_g = std::min(format.limit_g, level_g);
                         });
      },
      {parameter("level_g", "g", {6}, 1, 8, "a wrong range setting or a low supply: 5 to 8 g")});
}

}  // namespace sixpoint::sim
