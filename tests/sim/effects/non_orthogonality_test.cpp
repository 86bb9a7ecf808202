#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

// Oracle: the wGT3X-BT with the largest cross-axis of those that were measured (docs/constants.md).
TEST(NonOrthogonality, TheCrossAxisOfRealUnitsIsPlausible) {
  const EffectKind& kind = **find_effect("non_orthogonality");
  for (const double term : {0.0288, -0.0239, -0.0015, 0.0035}) {
    EXPECT_GT(term, kind.parameters[0].low);
    EXPECT_LT(term, kind.parameters[0].high);
  }
  const SimulatedBlock block =
      run("non_orthogonality", {{"yz_xz_xy", {0.0035, -0.0015, 0.0288}}}, {1, 0, 0});
  EXPECT_NEAR(block.sensed_g[0].y(), 0.0288, 1e-12);
  EXPECT_NEAR(block.sensed_g[0].z(), -0.0015, 1e-12);
}

// Oracle: a symmetric matrix with ones on its diagonal, column by column.
TEST(NonOrthogonality, TheTermsAreSymmetric) {
  const auto effect = made_effect("non_orthogonality", {{"yz_xz_xy", {0.01, 0.02, -0.03}}});
  EXPECT_LT((sensed_under(*effect, {1, 0, 0}) - Eigen::Vector3d(1, -0.03, 0.02)).norm(), 1e-12);
  EXPECT_LT((sensed_under(*effect, {0, 1, 0}) - Eigen::Vector3d(-0.03, 1, 0.01)).norm(), 1e-12);
  EXPECT_LT((sensed_under(*effect, {0, 0, 1}) - Eigen::Vector3d(0.02, 0.01, 1)).norm(), 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
