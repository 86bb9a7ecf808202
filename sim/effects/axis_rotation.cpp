// What is stored has its axes permuted or reversed: the matrix maps the right axes to the stored
// ones. The default is what firmware 1.6.0 does: x stored = -y, y stored = x.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

namespace {

class AxisRotation final : public Effect {
 public:
  explicit AxisRotation(const ParameterSet& values) {
    const std::vector<double>& rows = values.at("matrix");
    for (Eigen::Index row = 0; row < 3; ++row) {
      for (Eigen::Index column = 0; column < 3; ++column) {
        matrix_(row, column) = rows[static_cast<std::size_t>(3 * row + column)];
      }
    }
  }
  void on_firmware(SimulatedBlock& block) override {
    for (gt3x::Counts& counts : block.stored) {
      const Eigen::Vector3d turned = matrix_ * Eigen::Vector3d(counts[0], counts[1], counts[2]);
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        counts[axis] = static_cast<std::int16_t>(
            std::clamp<double>(std::round(turned[static_cast<Eigen::Index>(axis)]), -2048, 2047));
      }
    }
  }

 private:
  Eigen::Matrix3d matrix_;
};

}  // namespace

EffectKind axis_rotation_kind() {
  return {"axis_rotation",
          Stage::sensor,
          "axes permuted or reversed",
          {{"matrix",
            "1",
            {0, -1, 0, 1, 0, 0, 0, 0, 1},
            -1,
            1,
            "firmware 1.6.0 (16CPAN03); a board mounted the other way round"}},
          [](const ParameterSet& values, Random) -> std::unique_ptr<Effect> {
            return std::make_unique<AxisRotation>(values);
          }};
}

}  // namespace sixpoint::sim
