#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "gap/judge/made_step.h"

namespace sixpoint::gap {
namespace {

using tests::effect;
using tests::Made;

TEST(JudgeMarks, EvidenceIsPerSample) {
  Made made(tests::made_production({}));
  made.clean.zeros = {1, 200, {3}};
  made.clean.wrapped_samples = 10;
  made.clean.saturated = true;
  made.clean.plateau_samples = 50;
  made.clean.plateau_lsb = {{{-1500, 1540}, {0, 1536}, {0, 0}}};
  const Findings found = judge_marks(made.request, made.clean);
  ASSERT_NE(effect(found, "charging_zeros"), nullptr);
  EXPECT_EQ(effect(found, "charging_zeros")->nats, 3 * 200 - 3.5);
  EXPECT_EQ(effect(found, "charging_zeros")->parameters[0].value[0], 2) << "seconds";
  EXPECT_EQ(effect(found, "wrap")->nats, 5 * 10 - 3.5);
  // Half of 3040 counts on x, 1536 on y, at 256 per g.
  EXPECT_NEAR(effect(found, "saturation")->parameters[0].value[0], (1520 + 1536) / 2.0 / 256,
              1e-12);
  EXPECT_EQ(found.outside_means.size(), 3U);
  EXPECT_NEAR(found.outside_means[0].mg2, 333'333 * 200.0 / 18'000, 1e-9);
  EXPECT_TRUE(found.alarms.empty());
}

TEST(JudgeMarks, WhatIsNotInTheCatalogueAlarms) {
  Made made(tests::made_production({}), {.without = {"idle_sleep", "axis_rotation"}});
  made.clean.held = {1, 300, {2}};
  made.clean.axes_turned = true;
  made.clean.axes_gain_g = 1.2;
  const Findings found = judge_marks(made.request, made.clean);
  EXPECT_TRUE(found.effects.empty());
  ASSERT_EQ(found.alarms.size(), 2U);
  EXPECT_EQ(found.alarms[1].where, "codes: one value repeated for a second and more (300 samples)");
}

// What judge_codes() says of repeats beside 1/f noise of a density of 1 mg^2 / f, drawn here: pairs
// of neighbours, and pairs whose further change has half the mean square ln 7 (mg^2).
Findings judged_beside_flicker(bool accepted) {
  constexpr std::size_t kPairs = 360'000;
  const double lsb_mg = 1000.0 / 256;
  const double white_lsb = 1;
  const double further_lsb = std::sqrt(2 * std::log(7)) / lsb_mg;
  std::mt19937_64 random(6);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> anywhere(-0.5, 0.5);
  double near = 0;
  double far = 0;
  for (std::size_t i = 0; i < kPairs; ++i) {
    bool near_equal = true;
    bool far_equal = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const double mean = anywhere(random);
      const double first = std::round(mean + white_lsb * normal(random));
      near_equal &= first == std::round(mean + white_lsb * normal(random));
      far_equal &=
          first == std::round(mean + white_lsb * normal(random) + further_lsb * normal(random));
    }
    near += near_equal ? 1 : 0;
    far += far_equal ? 1 : 0;
  }
  Made made(tests::made_production({}));
  Records records;
  records.codes.samples = kPairs;
  records.codes.odd_share = {0.5, 0.5, 0.5};
  records.codes.repeats_excess_sd = (near - far) / std::sqrt(near + far + 1);
  records.noise.white_mg = {lsb_mg, lsb_mg, lsb_mg};
  Findings before;
  if (accepted) {
    before.add(made.request, {.name = "flicker", .nats = 9});
  }
  const double slow_mg2 = accepted ? std::log(7 * 100.0 / 2) : 0;
  return judge_codes(made.request, records, slow_mg2, before);
}

TEST(JudgeCodes, RepeatsThatSlowNoiseMakesAreExpected) {
  const Findings alone = judged_beside_flicker(false);
  ASSERT_EQ(alone.alarms.size(), 1U);
  EXPECT_EQ(alone.alarms[0].where, "codes: values repeat more often than chance");
  EXPECT_GT(alone.alarms[0].sd, 8);
  const Findings beside = judged_beside_flicker(true);
  EXPECT_TRUE(beside.alarms.empty());
  EXPECT_LT(beside.worst_sd, 2.5);
}

// What a filter leaves of the noise stays on one value for long by chance.
TEST(JudgeCodes, ShortRunsAlarmButNotBehindAFilter) {
  const Made made(tests::made_production({}));
  Records records;
  records.clean.stuck = {1, 25, {2}};
  const Findings plain = judge_codes(made.request, records, 0, {});
  ASSERT_EQ(plain.alarms.size(), 1U);
  EXPECT_EQ(plain.alarms[0].where, "codes: 1 short runs of one value");
  records.response.low_pass_significant = true;
  EXPECT_TRUE(judge_codes(made.request, records, 0, {}).alarms.empty());
}

// A share of the samples repeats the one before.
TEST(JudgeTexture, RepeatedSamplesAreNoOtherNoise) {
  constexpr double kShare = 0.08;
  std::mt19937_64 random(9);
  std::normal_distribution<double> noise_g(0, 0.0039);
  std::bernoulli_distribution repeats(kShare);
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  tests::MadeUnit unit;
  unit.noise_g.setConstant(1e-6);
  const Made made(tests::made_production(unit, [&](const Segment& s, double) {
    if (!repeats(random)) {
      last = Eigen::Vector3d(noise_g(random), noise_g(random), noise_g(random));
    }
    return Eigen::Vector3d(s.rotation.col(2) + last);
  }));
  Records records;
  records.clean = made.clean;
  records.noise = made.noise;
  EXPECT_FALSE(judge_texture(made.request, records, {}).alarms.empty());
  Findings before;
  before.add(made.request,
             {.name = "duplicated_samples", .nats = 9, .parameters = {{"rate", {kShare}, {}}}});
  EXPECT_TRUE(judge_texture(made.request, records, before).alarms.empty());
}

// Alarms about noise that is louder by this share in every third dwell, beside a vibration of the
// floor of this size.
std::size_t texture_alarms(double louder, double line_mg) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise_g(0, 0.0039);
  const Made made(tests::made_production({}, [&](const Segment& s, double t) {
    const double up = 1e-3 * line_mg * std::sin(2 * M_PI * 12 * t);
    const double size = s.first_sample / 1000 % 3 == 0 ? louder : 0;
    return Eigen::Vector3d((1 + up) * s.rotation.col(2) + size * Eigen::Vector3d(noise_g(random),
                                                                                 noise_g(random),
                                                                                 noise_g(random)));
  }));
  Records records;
  records.clean = made.clean;
  records.noise = made.noise;
  if (line_mg > 0) {
    records.lines.list.emplace_back().frequency_hz = 12;
    records.lines.power_mg2 = line_mg * line_mg / 2;
  }
  return judge_texture(made.request, records, {}).alarms.size();
}

TEST(JudgeTexture, NoiseIsJudgedBesideASmallLineButNotBesideAStrongOne) {
  EXPECT_EQ(texture_alarms(0, 0), 0U);
  EXPECT_EQ(texture_alarms(0, 1), 0U);
  EXPECT_GT(texture_alarms(1, 0), 0U);
  EXPECT_GT(texture_alarms(1, 1), 0U);
  EXPECT_EQ(texture_alarms(1, 6), 0U);
}

}  // namespace
}  // namespace sixpoint::gap
