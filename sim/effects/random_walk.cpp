// The zero walks: 1/f^2 noise. It walks on between segments.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class RandomWalk final : public Effect {
 public:
  RandomWalk(const ParameterSet& values, Random random)
      : g_per_sqrt_s_(values.at("mg_per_sqrt_s")[0] / kMgPerG), random_(random) {}
  void on_sensor(SimulatedBlock& block) override {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double step = g_per_sqrt_s_ * std::sqrt(std::max(0.0, block.time_s[i] - last_s_));
      last_s_ = std::max(last_s_, block.time_s[i]);
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        at_g_[axis] += step * random_.normal();
      }
      block.sensed_g[i] += at_g_;
    }
  }

 private:
  double g_per_sqrt_s_;
  Random random_;
  double last_s_ = 0;
  Eigen::Vector3d at_g_ = Eigen::Vector3d::Zero();
};

}  // namespace

EffectKind random_walk_kind() {
  return {"random_walk",
          Stage::sensor,
          "1/f^2 noise: the zero walks",
          {{"mg_per_sqrt_s",
            "mg/sqrt(s)",
            {0.2},
            0,
            1,
            "0.1 to 0.3 mg after a second, growing with the square root of time"}},
          [](const ParameterSet& values, Random random) -> std::unique_ptr<Effect> {
            return std::make_unique<RandomWalk>(values, random);
          }};
}

}  // namespace sixpoint::sim
