// The sample clock runs fast (positive) or slow: samples come earlier or later than they should.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class ClockError final : public Effect {
 public:
  explicit ClockError(const ParameterSet& values) : factor_(1 / (1 + values.at("ppm")[0] * 1e-6)) {}
  void on_sampling(SimulatedBlock& block) override {
    for (double& time_s : block.time_s) {
      time_s = block.clock_start_s + (time_s - block.clock_start_s) * factor_;
    }
  }

 private:
  double factor_;
};

}  // namespace

EffectKind clock_error_kind() {
  return {"clock_error",
          Stage::sampling,
          "the sample clock is off; positive runs fast",
          {{"ppm",
            "ppm",
            {500},
            -5000,
            5000,
            "watch crystals 10 to 100 ppm; the ADXL362's own oscillator several thousand"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<ClockError>(values);
          }};
}

}  // namespace sixpoint::sim
