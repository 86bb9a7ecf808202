// A line fixed in the laboratory: machines shake the floor.
// Its phase is drawn; it runs on between segments.
#include <cmath>
#include <numbers>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class FloorVibration final : public Effect {
 public:
  FloorVibration(const ParameterSet& values, Random random)
      : vector_g_(vector_of(values, "vector_mg") / kMgPerG),
        omega_(2 * std::numbers::pi * values.at("frequency_hz")[0]),
        phase_rad_(random.uniform(0, 2 * std::numbers::pi)) {}
  void on_stimulus(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.motion[i].force_lab_g += std::sin(omega_ * block.time_s[i] + phase_rad_) * vector_g_;
    }
  }

 private:
  Eigen::Vector3d vector_g_;
  double omega_;
  double phase_rad_;
};

}  // namespace

EffectKind floor_vibration_kind() {
  return {"floor_vibration",
          Stage::stimulus,
          "a line fixed in the laboratory: machines shake the floor",
          {{"vector_mg",
            "mg",
            {0.7, 0.3, 0.7},
            -5,
            5,
            "machinery and building modes on a bench: 0.1 to 5 mg, 5 to 30 Hz (peak, per axis)"},
           {"frequency_hz", "Hz", {12}, 0.1, 50, "5 to 30 Hz"}},
          [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
            return std::make_unique<FloorVibration>(values, random);
          }};
}

}  // namespace sixpoint::sim
