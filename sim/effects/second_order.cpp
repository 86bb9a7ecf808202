// The sensor's response is curved: K2 a^2 on every axis.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class SecondOrder final : public Effect {
 public:
  explicit SecondOrder(const ParameterSet& values) : k2_(values.at("mg_per_g2")) {}
  void on_sensor(SimulatedBlock& block) override {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        sensed[axis] += k2_[static_cast<std::size_t>(axis)] / kMgPerG * sensed[axis] * sensed[axis];
      }
    }
  }

 private:
  std::vector<double> k2_;
};

}  // namespace

EffectKind second_order_kind() {
  return {"second_order",
          Stage::sensor,
          "second-order nonlinearity, K2 a^2",
          {{"mg_per_g2",
            "mg/g^2",
            {0.3, 0.3, 0.3},
            -0.6,
            0.6,
            "ADXL362 datasheet: nonlinearity 0.5 % of full scale, mostly of higher order"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<SecondOrder>(values);
          }};
}

}  // namespace sixpoint::sim
