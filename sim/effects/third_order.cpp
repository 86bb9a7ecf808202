// The response is curved: K3 a^3 on every axis.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class ThirdOrder final : public Effect {
 public:
  explicit ThirdOrder(const ParameterSet& values)
      : k3_(vector_of(values, "mg_per_g3").array() / kMgPerG) {}
  void on_sensor(SimulatedBlock& block) override {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      sensed.array() += k3_ * sensed.array().cube();
    }
  }

 private:
  Eigen::Array3d k3_;
};

}  // namespace

EffectKind third_order_kind() {
  return {"third_order",
          Stage::sensor,
          "third-order nonlinearity, K3 a^3",
          {{"mg_per_g3",
            "mg/g^3",
            {0.04, 0.04, 0.04},
            -0.08,
            0.08,
            "ADXL362 datasheet: nonlinearity 0.5 % of full scale, 40 mg at 8 g"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<ThirdOrder>(values);
          }};
}

}  // namespace sixpoint::sim
