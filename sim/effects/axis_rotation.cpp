// What is stored has its axes permuted or reversed: the matrix maps the right axes to the stored
// ones. The default is what firmware 1.6.0 does: x stored = -y, y stored = x.
#include <algorithm>
#include <cmath>

#include "sim/effects/kinds.h"

namespace sixpoint::sim {

EffectKind axis_rotation_kind() {
  return effect_kind("axis_rotation", Stage::sensor, "axes permuted or reversed",
                     [](const ParameterSet& values, Random) {
                       Eigen::Matrix3d matrix;
                       for (Eigen::Index i = 0; i < matrix.size(); ++i) {
                         matrix(i / 3, i % 3) = values.at("matrix")[static_cast<std::size_t>(i)];
                       }
                       return stored_effect([matrix](gt3x::Counts& counts) {
                         const Eigen::Vector3d turned =
                             matrix * Eigen::Vector3d(counts[0], counts[1], counts[2]);
                         for (std::size_t axis = 0; axis < kAxes; ++axis) {
                           counts[axis] = static_cast<std::int16_t>(std::clamp<double>(
                               std::round(turned[static_cast<Eigen::Index>(axis)]), -2048, 2047));
                         }
                       });
                     },
                     {parameter("matrix", "1", {0, -1, 0, 1, 0, 0, 0, 0, 1}, -1, 1,
                                "firmware 1.6.0 (16CPAN03); a board mounted the other way round")});
}

}  // namespace sixpoint::sim
