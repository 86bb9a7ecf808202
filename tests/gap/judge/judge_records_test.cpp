#include <functional>

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
  EXPECT_NEAR(lines.found.outside_means.at(0).mg2, lines.power_mg2 / 3, 1e-9);
}

// Oracle: the lines that are put in. Of two of one kind both count and both stand in the effect.
TEST(JudgeRecords, ASecondLineOfTheSameKindStandsInTheEffect) {
  const auto shaken = tests::made_production({}, [](const Segment& s, double t) {
    const double phase = static_cast<double>(s.first_sample);
    const Eigen::Vector3d strong =
        0.004 * std::sin(2 * M_PI * 17.3 * t + phase) * Eigen::Vector3d(0.6, 0, 0.8);
    const Eigen::Vector3d weak =
        0.003 * std::sin(2 * M_PI * 12 * t + 2 * phase) * Eigen::Vector3d(0, 0.6, 0.8);
    return Eigen::Vector3d(s.rotation.col(2) + s.rotation * (strong + weak));
  });
  const Made made(shaken);
  const auto judged = [](const Made& of) {
    return judge_lines(of.request, of.clean, of.noise, code_statistics(of.bundle, of.clean)).found;
  };
  const Findings found = judged(made);
  const EffectFinding* line = effect(found, "floor_vibration");
  ASSERT_NE(line, nullptr);
  EXPECT_NEAR(line->parameters[1].value[0], 17.3, 0.05) << "the stronger one is first";
  ASSERT_EQ(line->further_lines.size(), 1U);
  EXPECT_EQ(line->further_lines[0][0].name, "vector_mg");
  EXPECT_NEAR(std::abs(line->further_lines[0][0].value[2]), 2.4, 0.3) << "mg on z";
  EXPECT_NEAR(line->further_lines[0][1].value[0], 12, 0.05);
  EXPECT_NEAR(line->gap_mg2, (16.0 + 9.0) / 6, 0.5) << "a sine's mean square, over three axes";
  ASSERT_EQ(line->all_parameters().size(), 4U);
  EXPECT_EQ(line->all_parameters()[3].value, line->further_lines[0][1].value);
  ASSERT_EQ(found.outside_means.size(), 2U);
  EXPECT_NEAR(found.outside_means[0].mg2 + found.outside_means[1].mg2, line->gap_mg2, 1e-9);
  // Without the name both are unknown, and both stay in the gap under it.
  const Findings stripped = judged(Made(shaken, {.without = {"floor_vibration"}}));
  EXPECT_EQ(stripped.alarms.size(), 2U);
  EXPECT_EQ(stripped.outside_means[1].effect, "floor_vibration");
}

// Findings on a vibration of the floor whose amplitude differs between dwells, 3 mg times a share.
Findings line_with(const std::function<double(std::size_t dwell)>& share) {
  const Made made(tests::made_production({}, [&](const Segment& s, double t) {
    const double phase = static_cast<double>(s.first_sample);
    const Eigen::Vector3d lab(0, 0.6, 0.8);
    return Eigen::Vector3d(s.rotation.col(2) + 0.003 * share(s.first_sample / 1000) *
                                                   std::sin(2 * M_PI * 12 * t + phase) *
                                                   (s.rotation * lab));
  }));
  return judge_lines(made.request, made.clean, made.noise, code_statistics(made.bundle, made.clean))
      .found;
}

TEST(JudgeRecords, ALineThatComesAndGoesIsUnknown) {
  const Findings steady = line_with([](std::size_t) { return 1; });
  EXPECT_NE(effect(steady, "floor_vibration"), nullptr);
  EXPECT_TRUE(steady.alarms.empty());
  // A real line is not quite steady.
  const Findings bent = line_with(
      [](std::size_t dwell) { return 1 + 0.1 * std::sin(2.0 * static_cast<double>(dwell)); });
  EXPECT_TRUE(bent.alarms.empty()) << bent.worst_sd;
  const Findings blower = line_with([](std::size_t dwell) { return dwell % 3 == 0 ? 0.2 : 1; });
  EXPECT_NE(effect(blower, "floor_vibration"), nullptr);
  ASSERT_EQ(blower.alarms.size(), 1);
  EXPECT_EQ(blower.alarms[0].where, "spectrum: the line at 12.00 Hz comes and goes");
  EXPECT_FALSE(blower.alarms[0].places.empty());
}

TEST(JudgeRecords, RingingAfterMovesIsSettling) {
  const auto ringing = tests::made_production({}, [](const Segment& s, double t) {
    const double ring = 0.04 * std::exp(-t / 0.4) * std::cos(2 * M_PI * 6 * t);
    return Eigen::Vector3d(s.rotation.col(2) + ring * s.approach_g);
  });
  const Made made(ringing);
  const Settling settling = judge_settling(made.request, made.clean, made.noise, {}, {});
  const EffectFinding* found = effect(settling.found, "settling");
  ASSERT_NE(found, nullptr);
  EXPECT_NEAR(found->parameters[0].value[0], 0.04, 0.01);
  EXPECT_NEAR(found->parameters[1].value[0], 6, 0.2);
  EXPECT_FALSE(settling.unexplained);
  // Behind a filter the ringing begins at nothing.
  const Made filtered(tests::made_production({}, [](const Segment& s, double t) {
    const double ring = 0.04 * std::exp(-t / 0.4) * std::cos(2 * M_PI * 6 * t);
    return Eigen::Vector3d(s.rotation.col(2) + (1 - std::exp(-t / 0.03)) * ring * s.approach_g);
  }));
  Response response;
  response.low_pass_significant = true;
  const Settling behind =
      judge_settling(filtered.request, filtered.clean, filtered.noise, {}, response);
  ASSERT_NE(effect(behind.found, "settling"), nullptr);
  EXPECT_NEAR(effect(behind.found, "settling")->parameters[0].value[0], 0.04, 0.01);
  const Made stripped(ringing, {.without = {"settling"}});
  EXPECT_TRUE(judge_settling(stripped.request, stripped.clean, stripped.noise, {}, {}).unexplained);
}

}  // namespace
}  // namespace sixpoint::gap
