// While it charges, the unit stores zero on all axes (paper, Step 2, third criterion).
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class ChargingZeros final : public Effect {
 public:
  explicit ChargingZeros(const ParameterSet& values)
      : begin_s_(values.at("start_s")[0]), end_s_(begin_s_ + values.at("duration_s")[0]) {}
  void on_firmware(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (block.time_s[i] >= begin_s_ && block.time_s[i] < end_s_) {
        block.stored[i] = {};
      }
    }
  }

 private:
  double begin_s_;
  double end_s_;
};

}  // namespace

EffectKind charging_zeros_kind() {
  return {"charging_zeros",
          Stage::firmware,
          "zero on all axes while the unit charges",
          {{"start_s", "s", {60}, 0, 1e6, "since the start of the recording"},
           {"duration_s", "s", {60}, 1, 1e5, "a charge takes up to two hours"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<ChargingZeros>(values);
          }};
}

}  // namespace sixpoint::sim
