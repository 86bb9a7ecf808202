// The front end clips below full scale.
#include <algorithm>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Saturation final : public Effect {
 public:
  explicit Saturation(const ParameterSet& values) : level_g_(std::abs(values.at("level_g")[0])) {}
  void on_analog(SimulatedBlock& block) override {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        sensed[axis] = std::clamp(sensed[axis], -level_g_, level_g_);
      }
    }
  }

 private:
  double level_g_;
};

}  // namespace

EffectKind saturation_kind() {
  return {"saturation",
          Stage::digital,
          "clips below full scale",
          {{"level_g", "g", {6}, 1, 8, "a wrong range setting or a low supply: 5 to 8 g"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<Saturation>(values);
          }};
}

}  // namespace sixpoint::sim
