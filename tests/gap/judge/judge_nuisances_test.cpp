#include <gtest/gtest.h>

#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

using tests::effect;
using tests::Made;

ForwardState unit(const Eigen::Vector3d& gain, const Eigen::Vector3d& offset_mg) {
  ForwardState state;
  state.gain = gain;
  state.offset_mg = offset_mg;
  return state;
}

TEST(JudgeNuisances, GainsAsUnitsHaveThem) {
  const Made made(tests::made_production({}));
  const Nuisances n = judge_nuisances(made.request, unit({1.02, 0.98, 1.01}, {20, -30, 40}), true);
  EXPECT_TRUE(n.found.effects.empty());
  EXPECT_TRUE(n.found.alarms.empty());
  EXPECT_EQ(n.unit.gain[1], 0.98);
  EXPECT_EQ(n.unit.offset_g[2], 0.04);
}

TEST(JudgeNuisances, ACommonGainIsTheWrongMode) {
  const Made made(tests::made_production({}));
  const auto state = unit({0.88, 0.87, 0.89}, {120, -160, 100});
  const Nuisances n = judge_nuisances(made.request, state, true);
  const EffectFinding* mode = effect(n.found, "filter_mismatch");
  ASSERT_NE(mode, nullptr);
  EXPECT_NEAR(mode->parameters[0].value[0], 0.88, 0.005);
  EXPECT_NEAR(n.unit.gain[0], 1, 0.01) << "the unit's own gain";
  EXPECT_EQ(n.unit.offset_g[0], 0);
  const Nuisances estimated = judge_nuisances(made.request, state, false);
  EXPECT_EQ(estimated.unit.gain[0], 0.88);
  EXPECT_TRUE(estimated.found.candidates.empty()) << "not judged";
}

// A quarter too low is what a unit of 256 LSB/g reads where the protocol says 341; here it says
// 256.
TEST(JudgeNuisances, AQuarterTooLowIsTheWrongModeWhereTheScaleIsRight) {
  const Made made(tests::made_production({}));
  const Nuisances n =
      judge_nuisances(made.request, unit({0.74, 0.75, 0.735}, {-130, -67, -102}), true);
  EXPECT_NE(effect(n.found, "filter_mismatch"), nullptr);
  EXPECT_TRUE(n.found.alarms.empty());
}

// One axis is astray: that is no wrong mode, and nothing is said of a scale that is right.
TEST(JudgeNuisances, OneGainAstrayIsNoScale) {
  const Made made(tests::made_production({}));
  const Nuisances n = judge_nuisances(made.request, unit({0.8, 1.01, 0.99}, {5, -9, 4}), true);
  EXPECT_EQ(effect(n.found, "filter_mismatch"), nullptr);
  ASSERT_FALSE(n.found.alarms.empty());
  for (const auto& alarm : n.found.alarms) {
    EXPECT_EQ(alarm.where.find("scale"), std::string::npos) << alarm.where;
  }
}

TEST(JudgeNuisances, TheScaleOfAnotherUnitIsSaid) {
  Bundle bundle = tests::made_production({});
  bundle.accel_scale_lsb_per_g = 341;
  const Made made(std::move(bundle));
  const double ratio = 256.0 / 341;
  const Nuisances n =
      judge_nuisances(made.request, unit({ratio, 1.01 * ratio, 0.99 * ratio}, {5, -9, 4}), true);
  EXPECT_EQ(effect(n.found, "filter_mismatch"), nullptr);
  ASSERT_FALSE(n.found.alarms.empty());
  EXPECT_EQ(n.found.alarms.back().where,
            "scale: the gains are those of a unit of 256 LSB/g, the protocol says 341");
}

}  // namespace
}  // namespace sixpoint::gap
