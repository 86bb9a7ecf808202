// The sensitivity moves with the temperature of the die, relative to 25 C.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class SensitivityTempco final : public Effect {
 public:
  explicit SensitivityTempco(const ParameterSet& values)
      : per_c_(vector_of(values, "percent_per_c").array() / 100) {}
  void on_sensor(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.sensed_g[i].array() *= 1 + per_c_ * (block.temperature_c[i] - kReferenceTemperature_c);
    }
  }

 private:
  Eigen::Array3d per_c_;
};

}  // namespace

EffectKind sensitivity_tempco_kind() {
  return {"sensitivity_tempco",
          Stage::sensor,
          "the sensitivity moves with temperature",
          {{"percent_per_c",
            "%/C",
            {0.03, 0.03, 0.03},
            -0.05,
            0.05,
            "ADXL362 datasheet: 0.05 %/C, typical"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<SensitivityTempco>(values);
          }};
}

}  // namespace sixpoint::sim
