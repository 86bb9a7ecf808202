#include <gtest/gtest.h>

#include "gap/explain/made_blocks.h"
#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

using tests::effect;
using tests::Made;

// Records without any slow noise.
SlowNoise no_slow_noise() {
  SlowNoise slow;
  slow.walk_mg = {0, 0.1, 0.5};
  slow.flicker_mg = {0, 0.1, 0.5};
  slow.nats = {{0, -5, -50}, {-5, -9, -60}, {-50, -60, -99}};
  return slow;
}

TEST(JudgeMeans, ATiltHasItsAngle) {
  const auto blocks = tests::made_dwells([](const Block& b) -> Eigen::Vector3d {
    const Eigen::Vector3d turn = Eigen::Vector3d(0.2, -0.15, 0) * M_PI / 180;
    return 1000 * b.rotation * turn.cross(Eigen::Vector3d::UnitZ());
  });
  const Made made(tests::made_production({}));
  const SlowNoise slow = no_slow_noise();
  const Explanation explanation = explain(made.request, blocks, slow);
  const Findings found = judge_means(made.request, explanation, slow, {});
  const EffectFinding* tilt = effect(found, "tilt");
  ASSERT_NE(tilt, nullptr);
  ASSERT_EQ(tilt->parameters[0].value.size(), 3U) << "a rotation vector";
  EXPECT_EQ(tilt->parameters[0].value[2], 0);
  EXPECT_TRUE(std::isnan(tilt->parameters[0].sd[2])) << "a turn about the vertical is not shown";
  // Five parts in a hundred of the size are common to units.
  EXPECT_NEAR(tilt->parameters[0].form_sd[0], 0.05 * std::abs(tilt->parameters[0].value[0]), 1e-12);
  EXPECT_GE(tilt->parameters[0].sd[0], tilt->parameters[0].form_sd[0]);
  EXPECT_NEAR(tilt->parameters[1].value[0], 0.25, 0.02) << "hypot(0.2, 0.15)";
  EXPECT_GT(tilt->held_out_gain_nats, 10);
}

TEST(JudgeMeans, NothingMissingNamesNothing) {
  const auto blocks = tests::made_dwells({}, 3);
  const Made made(tests::made_production({}), {.without = {"flicker"}});
  const SlowNoise slow = no_slow_noise();
  const Explanation explanation = explain(made.request, blocks, slow);
  const Findings found = judge_means(made.request, explanation, slow, {});
  EXPECT_TRUE(found.effects.empty());
  EXPECT_TRUE(found.alarms.empty());
  for (const EffectFinding& candidate : found.candidates) {
    EXPECT_NE(candidate.name, "flicker");
    EXPECT_LT(candidate.probability, 0.5) << candidate.name;
    if (candidate.name == "rounding_floor") {
      EXPECT_EQ(candidate.confounded_with, std::vector<std::string>{"offset"});
    }
  }
}

// The zero moves by 6 mg halfway: no slow effect of the catalogue explains all of it.
TEST(JudgeMeans, AZeroThatMovesOnceAlarms) {
  const auto blocks = tests::made_dwells([](const Block& b) -> Eigen::Vector3d {
    return b.placement >= 9 ? Eigen::Vector3d(6, -4, 5) : Eigen::Vector3d(0, 0, 0);
  });
  const Made made(tests::made_production({}));
  const SlowNoise slow = no_slow_noise();
  const Explanation explanation = explain(made.request, blocks, slow);
  const Findings found = judge_means(made.request, explanation, slow, {});
  EXPECT_TRUE(explanation.unknown_wins() || !found.alarms.empty());
}

// Three hours of a drift of 5 mg/h: from the plain law, with a ripple of `share` of it from crest
// to trough (2.3 periods, which are none of the model's own functions).
Findings of_rippling_drift(double share, unsigned seed) {
  constexpr double kSpan_s = 17 * 640;
  auto blocks = tests::made_dwells(
      [&](const Block& b) -> Eigen::Vector3d {
        const double ripple_h =
            share / 2 * kSpan_s / 3600 * std::sin(2 * M_PI * 2.3 * b.middle_s / kSpan_s);
        return (b.middle_s / 3600 + ripple_h) * Eigen::Vector3d(5, -3, 1);
      },
      seed, 640);
  set_ripples(blocks);
  const Made made(tests::made_production({}));
  const SlowNoise slow = no_slow_noise();
  const Explanation explanation = explain(made.request, blocks, slow);
  Findings found = judge_means(made.request, explanation, slow, {});
  if (explanation.unknown_wins()) {
    found.alarm(2 * kAlarm_sd, "unknown");
  }
  return found;
}

TEST(JudgeMeans, ADriftThatRipplesByATenthKeepsItsName) {
  for (const double share : {0.0, 0.04, 0.1}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      const Findings found = of_rippling_drift(share, seed);
      EXPECT_TRUE(found.alarms.empty()) << share << ", " << found.alarms.front().where;
      const EffectFinding* drift = effect(found, "drift");
      ASSERT_NE(drift, nullptr) << share;
      EXPECT_NEAR(drift->parameters[0].value[0], 5, 0.5) << share;
      EXPECT_EQ(found.effects.size(), 1U) << share;
    }
  }
}

TEST(JudgeMeans, AZeroThatWandersByMoreThanADriftDoesAlarms) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    EXPECT_FALSE(of_rippling_drift(0.6, seed).alarms.empty());
  }
}

}  // namespace
}  // namespace sixpoint::gap
