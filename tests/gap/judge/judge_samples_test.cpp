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
  EXPECT_EQ(found.outside_means_mg2.size(), 3U);
  EXPECT_NEAR(found.outside_means_mg2[0], 333'333 * 200.0 / 18'000, 1e-9);
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
