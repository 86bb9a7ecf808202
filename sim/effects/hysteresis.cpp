// The reading depends on the direction of approach: an axis whose specific force last rose reads
// high by this much, one whose specific force last fell reads low. Before the first move: neither.
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class Hysteresis final : public Effect {
 public:
  explicit Hysteresis(const ParameterSet& values) : g_(vector_of(values, "mg") / kMgPerG) {}
  void on_placement(const Placement& placement) override {
    constexpr double kLeastMove_g = 0.1;
    const Eigen::Vector3d move =
        (placement.rotation - placement.previous) * Eigen::Vector3d::UnitZ();
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      if (std::abs(move[axis]) > kLeastMove_g) {
        held_g_[axis] = move[axis] > 0 ? g_[axis] : -g_[axis];
      }
    }
  }
  void on_sensor(SimulatedBlock& block) override {
    for (Eigen::Vector3d& sensed : block.sensed_g) {
      sensed += held_g_;
    }
  }

 private:
  Eigen::Vector3d g_;
  Eigen::Vector3d held_g_ = Eigen::Vector3d::Zero();
};

}  // namespace

EffectKind hysteresis_kind() {
  return {"hysteresis",
          Stage::sensor,
          "the reading depends on the direction of approach",
          {{"mg",
            "mg",
            {0.8, 0.8, 0.8},
            -2,
            2,
            "half the difference between approaches; stress in package and board: 0.2 to 2 mg"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<Hysteresis>(values);
          }};
}

}  // namespace sixpoint::sim
