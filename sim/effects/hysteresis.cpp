// The reading depends on the direction of approach: an axis whose specific force last rose reads
// high by this much, one whose specific force last fell reads low. Before the first move: neither.
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind hysteresis_kind() {
  return effect_kind(
      "hysteresis", Stage::sensor, "the reading depends on the direction of approach",
      [](const ParameterSet& values, Random) {
        auto made = std::make_unique<Parts>();
        auto held_g = std::make_shared<Eigen::Vector3d>(Eigen::Vector3d::Zero());
        const Eigen::Vector3d g = vector_of(values, "mg") / kMgPerG;
        made->placement = [held_g, g](const Placement& placement) {
          constexpr double kLeastMove_g = 0.1;
          const Eigen::Vector3d move =
              (placement.rotation - placement.previous) * Eigen::Vector3d::UnitZ();
          for (Eigen::Index axis = 0; axis < 3; ++axis) {
            if (std::abs(move[axis]) > kLeastMove_g) {
              (*held_g)[axis] = move[axis] > 0 ? g[axis] : -g[axis];
            }
          }
        };
        made->sensor = [held_g](SimulatedBlock& block) {
          for (Eigen::Vector3d& sensed : block.sensed_g) {
            sensed += *held_g;
          }
        };
        return made;
      },
      {parameter(
          "mg", "mg", {0.8, 0.8, 0.8}, -2, 2,
          "half the difference between approaches; stress in package and board: 0.2 to 2 mg")});
}

}  // namespace sixpoint::sim
