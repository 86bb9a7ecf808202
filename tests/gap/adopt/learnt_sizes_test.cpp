// What a population says of the next unit, and what the diagnosis makes of it.
#include "gap/adopt/learnt_sizes.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gap/judge/diagnose.h"
#include "gap/made_bundle.h"
#include "sim/bundle_writer.h"
#include "sim/scenario.h"

namespace sixpoint::gap {
namespace {

constexpr const char* kPopulation = R"({"protocol": "production", "population": {"effects": [
  {"name": "offset_tempco", "units": 9, "bundles": 12, "mean": {"mg_per_c": [0.4, -0.3, 0.3]},
   "spread": {"mg_per_c": [0.1, 0.1, 0]}, "standard_uncertainty": {"mg_per_c": [0.04, 0.03, 0.003]}},
  {"name": "tilt", "units": 3, "mean": {"rotation_vector_deg": [0.2, 0.1, 0]},
   "spread": {"rotation_vector_deg": [0.03, 0.02, 0]}},
  {"name": "drift", "units": 1, "mean": {"mg_per_h": [1, 1, 1]}, "spread": {"mg_per_h": null}},
  {"name": "non_orthogonality", "mean": {"yz_xz_xy": [0.001, 0, 0]}, "spread": {"yz_xz_xy": null}},
  {"name": "seating", "units": 5, "mean": {"sd_deg": 0.08}, "spread": {"sd_deg": 0.02}},
  {"name": "local_gravity", "mean": {"ratio": 1.001}, "spread": {"ratio": 0.0002}}]}})";

TEST(LearntSizes, SpreadAndUncertaintyOfTheMeanAddUp) {
  const auto learnt = learnt_sizes(kPopulation);
  ASSERT_OK(learnt);
  ASSERT_EQ(learnt->size(), 3U) << "neither one unit nor an unknown spread says anything of the "
                                   "next; scatter is not in the means";
  const LearntSize& gravity = (*learnt)[0];
  EXPECT_EQ(gravity.effect, "local_gravity");
  EXPECT_EQ(gravity.units, 0U) << "written by hand";
  EXPECT_NEAR(gravity.mean[0], 0.001, 1e-12) << "beyond the reference";
  EXPECT_NEAR(gravity.sd[0], 0.0002, 1e-12);
  const LearntSize& tempco = (*learnt)[1];
  EXPECT_EQ(tempco.units, 9U);
  EXPECT_EQ(tempco.mean, (std::vector<double>{0.4, -0.3, 0.3}));
  EXPECT_NEAR(tempco.sd[0], std::hypot(0.1, 0.04) * std::sqrt(8.0 / 6), 1e-12) << "Student's t";
  EXPECT_NEAR(tempco.sd[2], 0.025, 1e-12) << "a twentieth of the typical 0.5 mg/C";
  const LearntSize& tilt = (*learnt)[2];
  EXPECT_EQ(tilt.mean, (std::vector<double>{0.2, 0.1})) << "about the vertical it moves nothing";
  EXPECT_NEAR(tilt.sd[1], 3 * 0.02, 1e-12) << "three units";
}

TEST(LearntSizes, AScenarioWithoutAPopulationIsRefused) {
  EXPECT_FAILS(learnt_sizes(R"({"protocol": "production"})"), ErrorCode::configuration);
  EXPECT_FAILS(learnt_sizes("[]"), ErrorCode::configuration);
  EXPECT_FAILS(learnt_sizes(R"({"population": {"effects": [{"name": "fire"}]}})"),
               ErrorCode::configuration);
}

// Units by tests/gap/made_bundle.h, which shares no code with the simulator or the diagnosis:
// cross-axis terms just below what six faces show without knowing what to expect.
Bundle weak_unit(unsigned seed, double share) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const Eigen::Vector3d s =
      share * (Eigen::Vector3d(0.00015, -0.00015, 0.00015) +
               0.00002 * Eigen::Vector3d(normal(random), normal(random), normal(random)));
  const tests::MadeForce force = [s](const Segment& segment, double) {
    const Eigen::Vector3d f = segment.rotation.col(2);
    return Eigen::Vector3d(f[0] + s[2] * f[1] + s[1] * f[2], f[1] + s[2] * f[0] + s[0] * f[2],
                           f[2] + s[1] * f[0] + s[0] * f[1]);
  };
  tests::MadeUnit unit;
  unit.seed = seed;
  return tests::made_production(unit, force);
}

int named(double share, const std::vector<LearntSize>& learnt, int units) {
  int count = 0;
  for (int i = 0; i < units; ++i) {
    const auto answer =
        diagnose(weak_unit(static_cast<unsigned>(500 + i), share), {.learnt = learnt});
    EXPECT_OK(answer);
    for (const EffectFinding& effect : answer->effects) {
      EXPECT_EQ(effect.name, "non_orthogonality") << i;
      EXPECT_EQ(effect.learnt_from_units, learnt.empty() ? 0U : 9U);
      count += effect.name == "non_orthogonality" ? 1 : 0;
    }
  }
  return count;
}

TEST(LearntSizes, WhatIsExpectedIsNamedEarlierAndNothingThatIsNotThere) {
  const std::vector<LearntSize> learnt = {{.effect = "non_orthogonality",
                                           .units = 9,
                                           .mean = {0.00015, -0.00015, 0.00015},
                                           .sd = {0.0003, 0.0003, 0.0003}}};
  constexpr int kUnits = 10;
  const int without = named(1, {}, kUnits);
  const int with = named(1, learnt, kUnits);
  const int absent = named(0, learnt, kUnits);
  RecordProperty("without", without);
  RecordProperty("with", with);
  EXPECT_GE(with, without + 3) << without;
  EXPECT_EQ(absent, 0);
}

// The answer speaks of the catalogue's parameter, which the simulator takes: 1 is no effect.
TEST(LearntSizes, GravityIsARatioInTheAnswerToo) {
  const auto scenario = sim::parse_scenario(R"({"protocol": "engineering", "seed": 5,
    "effects": [{"name": "local_gravity", "parameters": {"ratio": 1.0026}}]})");
  ASSERT_OK(scenario);
  MemoryEnv memory;
  ASSERT_OK(sim::write_bundle(memory.files, "b", *scenario));
  const auto bundle = read_bundle(memory.files, "b");
  ASSERT_OK(bundle);
  const auto answer = diagnose(*bundle);
  ASSERT_OK(answer);
  ASSERT_EQ(answer->effects.size(), 1U);
  const NamedValue& ratio = answer->effects.front().parameters.front();
  EXPECT_EQ(ratio.name, "ratio");
  EXPECT_NEAR(ratio.value[0], 1.0026, 3 * ratio.sd[0]);
  EXPECT_LT(ratio.sd[0], 0.0005);
}

}  // namespace
}  // namespace sixpoint::gap
