// After power-on the zero creeps to its final value: exponential in the time since then.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class WarmUp final : public Effect {
 public:
  explicit WarmUp(const ParameterSet& values)
      : g_(vector_of(values, "mg") / kMgPerG), tau_s_(std::max(1e-3, values.at("tau_s")[0])) {}
  void on_sensor(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      block.sensed_g[i] += std::exp(-std::max(0.0, block.time_s[i]) / tau_s_) * g_;
    }
  }

 private:
  Eigen::Vector3d g_;
  double tau_s_;
};

}  // namespace

EffectKind warm_up_kind() {
  return {
      "warm_up",
      Stage::sensor,
      "exponential after power-on",
      {{"mg",
        "mg",
        {4, 4, 4},
        -10,
        10,
        "self-heating by a few degrees times the zero tempco: 1 to 10 mg at power-on"},
       {"tau_s", "s", {300}, 30, 1200, "thermal time constant of a small case: 2 to 10 minutes"}},
      [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
        return std::make_unique<WarmUp>(values);
      }};
}

}  // namespace sixpoint::sim
