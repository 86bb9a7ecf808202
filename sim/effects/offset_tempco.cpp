// The zero moves with the die's temperature, relative to 25 C.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class OffsetTempco final : public Effect {
 public:
  explicit OffsetTempco(const ParameterSet& values) : mg_per_c_(values.at("mg_per_c")) {}
  void on_sensor(SimulatedBlock& block) override {
    const Eigen::Vector3d g_per_c =
        Eigen::Vector3d(mg_per_c_[0], mg_per_c_[1], mg_per_c_[2]) / kMgPerG;
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.sensed_g[i] += g_per_c * (block.temperature_c[i] - kReferenceTemperature_c);
    }
  }

 private:
  std::vector<double> mg_per_c_;
};

}  // namespace

EffectKind offset_tempco_kind() {
  return {"offset_tempco",
          Stage::sensor,
          "the zero moves with temperature",
          {{"mg_per_c",
            "mg/C",
            {0.4, 0.4, 0.4},
            -1,
            1,
            "ADXL362 datasheet: 0.5 mg/C x and y, 0.6 mg/C z, typical"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<OffsetTempco>(values);
          }};
}

}  // namespace sixpoint::sim
