// A line fixed in the sensor frame: electrical interference.
// Its phase is drawn; it runs on between segments.
#include <cmath>
#include <numbers>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class ElectricalLine final : public Effect {
 public:
  ElectricalLine(const ParameterSet& values, Random random)
      : vector_g_(vector_of(values, "vector_mg") / kMgPerG),
        omega_(2 * std::numbers::pi * values.at("frequency_hz")[0]),
        phase_rad_(random.uniform(0, 2 * std::numbers::pi)) {}
  void on_sensor(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.sensed_g[i] += std::sin(omega_ * block.time_s[i] + phase_rad_) * vector_g_;
    }
  }

 private:
  Eigen::Vector3d vector_g_;
  double omega_;
  double phase_rad_;
};

}  // namespace

EffectKind electrical_line_kind() {
  return {"electrical_line",
          Stage::sensor,
          "a line fixed in the sensor frame: electrical interference",
          {{"vector_mg",
            "mg",
            {0.7, 0.7, 0.7},
            -5,
            5,
            "supply ripple and aliased mains: 0.1 to 4 mg (peak, per axis)"},
           {"frequency_hz",
            "Hz",
            {17},
            0.1,
            50,
            "mains and their harmonics, aliased below half the sample rate"}},
          [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
            return std::make_unique<ElectricalLine>(values, random);
          }};
}

}  // namespace sixpoint::sim
