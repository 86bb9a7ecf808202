#include <gtest/gtest.h>

#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

using tests::effect;
using tests::Made;

TEST(JudgeRecords, ALineOfTheSensorIsElectrical) {
  const Made made(tests::made_production({}, [](const Segment& s, double t) {
    const double phase = static_cast<double>(s.first_sample);
    return Eigen::Vector3d(s.rotation.col(2) + 0.003 * std::sin(2 * M_PI * 12 * t + phase) *
                                                   Eigen::Vector3d(0.6, 0, 0.8));
  }));
  const Lines lines =
      judge_lines(made.request, made.clean, made.noise, code_statistics(made.bundle, made.clean));
  const EffectFinding* line = effect(lines.found, "electrical_line");
  ASSERT_NE(line, nullptr);
  EXPECT_NEAR(line->parameters[1].value[0], 12, 0.05);
  EXPECT_NEAR(std::abs(line->parameters[0].value[2]), 2.4, 0.3) << "mg on z";
  ASSERT_EQ(lines.list.size(), 1U);
  EXPECT_NEAR(lines.power_mg2, 4.5, 0.8) << "half of the square of 3 mg";
  EXPECT_NEAR(lines.found.outside_means_mg2.at(0), lines.power_mg2 / 3, 1e-9);
}

TEST(JudgeRecords, RingingAfterMovesIsSettling) {
  const auto ringing = tests::made_production({}, [](const Segment& s, double t) {
    const double ring = 0.04 * std::exp(-t / 0.4) * std::cos(2 * M_PI * 6 * t);
    return Eigen::Vector3d(s.rotation.col(2) + ring * s.approach_g);
  });
  const Made made(ringing);
  const Settling settling = judge_settling(made.request, made.clean, made.noise, {});
  const EffectFinding* found = effect(settling.found, "settling");
  ASSERT_NE(found, nullptr);
  EXPECT_NEAR(found->parameters[0].value[0], 0.04, 0.01);
  EXPECT_NEAR(found->parameters[1].value[0], 6, 0.2);
  EXPECT_FALSE(settling.unexplained);
  const Made stripped(ringing, {.without = {"settling"}});
  EXPECT_TRUE(judge_settling(stripped.request, stripped.clean, stripped.noise, {}).unexplained);
}

}  // namespace
}  // namespace sixpoint::gap
