#include "sim/effects/effect.h"

#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/simulator.h"

namespace sixpoint::sim {
namespace {

// Runs one still second without noise and gives the mean of what the sensor element had.
SimulatedBlock run(const char* name, const ParameterSet& given, const Eigen::Vector3d& up,
                   double temperature_c = 25) {
  const EffectKind* kind = *find_effect(name);
  GivenProperties properties;
  properties.noise_mg = PerAxis<double>{};
  const UnitTruth unit = draw_unit(1, properties);
  std::vector<std::unique_ptr<Effect>> effects;
  effects.push_back(kind->make(*complete_parameters(*kind, given), Random(1)));
  SimulatorOptions options;
  options.rate_hz = 100;
  options.temperature_c = temperature_c;
  const auto motion = still(rotation_with_up(up));
  Simulator simulator(unit, options, *motion, std::move(effects));
  SimulatedBlock block;
  simulator.next(200, block);
  return block;
}

TEST(Effects, EveryEntryIsWhole) {
  std::set<std::string> names;
  for (const EffectKind& kind : effect_catalogue()) {
    EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
    EXPECT_FALSE(kind.summary.empty());
    for (const Parameter& parameter : kind.parameters) {
      EXPECT_FALSE(parameter.unit.empty());
      EXPECT_FALSE(parameter.source.empty());
      EXPECT_LT(parameter.low, parameter.high);
      EXPECT_TRUE(parameter.default_value.size() == 1 || parameter.default_value.size() == 3 ||
                  parameter.default_value.size() == 9);
    }
    const auto values = complete_parameters(kind, {});
    ASSERT_OK(values);
    EXPECT_NE(kind.make(*values, Random(1)), nullptr);
  }
  EXPECT_FAILS(find_effect("gremlins"), ErrorCode::configuration);
  const EffectKind& tilt = **find_effect("tilt");
  EXPECT_FAILS(complete_parameters(tilt, {{"size", {1}}}), ErrorCode::configuration);
  EXPECT_FAILS(complete_parameters(tilt, {{"rotation_vector_deg", {1}}}), ErrorCode::configuration);
  EXPECT_FAILS(complete_parameters(tilt, {{"rotation_vector_deg", {1, 2, NAN}}}),
               ErrorCode::configuration);
}

// Oracle: the wGT3X-BT with the largest cross-axis of those that were measured (docs/constants.md).
TEST(Effects, TheCrossAxisOfRealUnitsIsPlausible) {
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

TEST(Effects, TheManualListsEveryEffectAndParameter) {
  std::ifstream file(std::string(SIXPOINT_SOURCE_DIR) + "/docs/scenario.md");
  std::stringstream manual;
  manual << file.rdbuf();
  for (const EffectKind& kind : effect_catalogue()) {
    const std::size_t row = manual.str().find("| `" + kind.name + "` |");
    ASSERT_NE(row, std::string::npos) << kind.name;
    const std::string line = manual.str().substr(row, manual.str().find('\n', row) - row);
    for (const Parameter& parameter : kind.parameters) {
      EXPECT_NE(line.find("`" + parameter.name + "` ("), std::string::npos)
          << kind.name << "." << parameter.name;
    }
  }
}

// Oracle: closed forms.
TEST(Effects, TiltTurnsGravityInTheLaboratory) {
  // What acts is turned by +1 degree about lab x: up leans towards -y.
  const SimulatedBlock block = run("tilt", {{"rotation_vector_deg", {1, 0, 0}}}, {0, 0, 1});
  const double angle = std::acos(-1.0) / 180;
  EXPECT_NEAR(block.true_g[0].y(), -std::sin(angle), 1e-12);
  EXPECT_NEAR(block.true_g[0].z(), std::cos(angle), 1e-12);
}

TEST(Effects, MisalignmentTurnsWhatTheSensorFeelsNotTheTruth) {
  const SimulatedBlock block = run("misalignment", {{"rotation_vector_deg", {0, 1, 0}}}, {0, 0, 1});
  EXPECT_NEAR(block.true_g[0].x(), 0, 1e-12);
  EXPECT_NEAR(std::abs(block.sensed_g[0].x()), std::sin(std::acos(-1.0) / 180), 1e-12);
}

TEST(Effects, SecondOrderAndTempco) {
  EXPECT_NEAR(run("second_order", {{"mg_per_g2", {0.5, 0.5, 0.5}}}, {0, 0, -1}).sensed_g[0].z(),
              -1 + 0.0005, 1e-12);
  EXPECT_NEAR(run("offset_tempco", {{"mg_per_c", {0, 0, 0.6}}}, {0, 0, 1}, 35).sensed_g[0].z(),
              1.006, 1e-12);
}

TEST(Effects, ClockErrorComesEarly) {
  const SimulatedBlock block = run("clock_error", {{"ppm", {1000}}}, {0, 0, 1});
  EXPECT_NEAR(block.time_s[100], 1 / 1.001, 1e-12);
}

TEST(Effects, ChargingStoresZeros) {
  const SimulatedBlock block =
      run("charging_zeros", {{"start_s", {0.5}}, {"seconds", {1}}}, {0, 0, 1});
  EXPECT_NE(block.stored[49], (gt3x::Counts{}));
  EXPECT_EQ(block.stored[50], (gt3x::Counts{}));
  EXPECT_EQ(block.stored[149], (gt3x::Counts{}));
  EXPECT_NE(block.stored[150], (gt3x::Counts{}));
}

TEST(Effects, TruncationMovesTowardZero) {
  const SimulatedBlock cut = run("truncation", {}, {0.3, -0.5, 0.8});
  const SimulatedBlock whole = run("tilt", {{"rotation_vector_deg", {0, 0, 0}}}, {0.3, -0.5, 0.8});
  int moved = 0;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_LE(std::abs(cut.stored[0][axis]), std::abs(whole.stored[0][axis]));
    moved += cut.stored[0][axis] != whole.stored[0][axis] ? 1 : 0;
  }
  EXPECT_GT(moved, 0);
}

}  // namespace
}  // namespace sixpoint::sim
