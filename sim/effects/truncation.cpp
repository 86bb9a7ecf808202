// The firmware cuts toward zero where it should round.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Truncation final : public Effect {
 public:
  void on_digital(NumberFormat& stored) override {
    stored.rounding = NumberFormat::Rounding::toward_zero;
  }
};

}  // namespace

EffectKind truncation_kind() {
  return {"truncation",
          Stage::digital,
          "stored counts are cut toward zero instead of rounded",
          {},
          [](const ParameterSet&, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<Truncation>();
          }};
}

}  // namespace sixpoint::sim
