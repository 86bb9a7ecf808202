// Stored counts overflow modulo 4096 instead of clipping.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Wrap final : public Effect {
 public:
  void on_digital(NumberFormat& stored) override { stored.wraps = true; }
};

}  // namespace

EffectKind wrap_kind() {
  return {"wrap",
          Stage::digital,
          "overflows modulo 4096",
          {},
          [](const ParameterSet&, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<Wrap>();
          }};
}

}  // namespace sixpoint::sim
