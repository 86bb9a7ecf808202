// The zero moves linearly in the time since power-on.
#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Drift final : public Effect {
 public:
  explicit Drift(const ParameterSet& values)
      : g_per_s_(vector_of(values, "mg_per_h") / kMgPerG / 3600) {}
  void on_sensor(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.sensed_g[i] += block.time_s[i] * g_per_s_;
    }
  }

 private:
  Eigen::Vector3d g_per_s_;
};

}  // namespace

EffectKind drift_kind() {
  return {
      "drift",
      Stage::sensor,
      "the zero moves linearly in time",
      {{"mg_per_h", "mg/h", {2, 2, 2}, -5, 5, "a fresh mount or a settling supply: 1 to 5 mg/h"}},
      [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
        return std::make_unique<Drift>(values);
      }};
}

}  // namespace sixpoint::sim
