// The firmware cuts toward zero where it should round.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind truncation_kind() {
  return effect_kind("truncation", Stage::digital,
                     "stored counts are cut toward zero instead of rounded",
                     [](const ParameterSet&, Random) {
                       return acting_at(&Parts::digital, [](NumberFormat& format) {
                         format.rounding = NumberFormat::Rounding::toward_zero;
                       });
                     });
}

}  // namespace sixpoint::sim
