#include <gtest/gtest.h>

#include "sim/effects/made_effect.h"

namespace sixpoint::sim {
namespace {

using namespace tests;

// Oracle: a common gain and an offset per axis, by hand.
TEST(FilterMismatch, ACommonGainAndAnOffsetOfEachAxis) {
  const auto effect =
      made_effect("filter_mismatch", {{"gain", {0.9}}, {"offset_g", {0.1, -0.15, 0.2}}});
  const Eigen::Vector3d flat = sensed_under(*effect, {0, 0, 1});
  EXPECT_NEAR(flat.x(), 0.1, 1e-12);
  EXPECT_NEAR(flat.y(), -0.15, 1e-12);
  EXPECT_NEAR(flat.z(), 1.1, 1e-12);
  const Eigen::Vector3d moving = sensed_under(*effect, {2, -3, 0.5});
  EXPECT_NEAR(moving.x(), 1.9, 1e-12);
  EXPECT_NEAR(moving.y(), -2.85, 1e-12);
  EXPECT_NEAR(moving.z(), 0.65, 1e-12);
}

// Oracle: what 16CPAN03 says, a recording that reads low by 5 to 20 %.
TEST(FilterMismatch, TheDefaultReadsLowAsTheAdvisorySays) {
  const auto effect = made_effect("filter_mismatch");
  const double span_g =
      sensed_under(*effect, {1, 0, 0}).x() - sensed_under(*effect, {-1, 0, 0}).x();
  EXPECT_GT(span_g / 2, 0.8);
  EXPECT_LT(span_g / 2, 0.95);
}

TEST(FilterMismatch, TheTruthStays) {
  const SimulatedBlock block = run("filter_mismatch", {}, {0, 0, 1});
  EXPECT_NEAR(block.true_g[0].z(), 1, 1e-12);
  EXPECT_NEAR(block.sensed_g[0].z(), 1.0, 1e-12);  // 0.88 + 0.12
  EXPECT_NEAR(block.sensed_g[0].x(), 0.12, 1e-12);
}

}  // namespace
}  // namespace sixpoint::sim
