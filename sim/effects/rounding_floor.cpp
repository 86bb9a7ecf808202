// Stored counts are rounded downward instead of to the nearest.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class RoundingFloor final : public Effect {
 public:
  void on_digital(NumberFormat& stored) override { stored.rounding = NumberFormat::Rounding::down; }
};

}  // namespace

EffectKind rounding_floor_kind() {
  return {"rounding_floor",
          Stage::digital,
          "stored counts are rounded downward",
          {},
          [](const ParameterSet&, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<RoundingFloor>();
          }};
}

}  // namespace sixpoint::sim
