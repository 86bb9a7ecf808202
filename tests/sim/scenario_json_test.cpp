#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "expect_result.h"
#include "sim/made_scenario.h"
#include "sim/scenario.h"
#include "sim/scenario_section.h"

namespace sixpoint::sim {
namespace {

using testing::HasSubstr;

TEST(ScenarioJson, ReadsAWholeOne) {
  const auto scenario = parse_scenario(tests::kWholeScenario);
  ASSERT_OK(scenario);
  EXPECT_EQ(scenario->unit.serial, "MOS2A45130007");
  EXPECT_EQ(scenario->unit.current.zero_lsb, (PerAxis<double>{49.9, 95.8, 60.8}));
  EXPECT_EQ(scenario->filter_in_force(), FilterConfiguration::current);
  EXPECT_EQ(scenario->motions.size(), 3U);
  EXPECT_EQ(scenario->effects.size(), 2U);
  EXPECT_DOUBLE_EQ(scenario->motion()->duration_s(), 20 + 2 + 5 + 2 + 60);
}

TEST(ScenarioJson, RefusesWhatItDoesNotKnow) {
  for (
      const char* text : {
          "",
          "[]",
          "{}",
          R"({"motions": []})",
          R"({"motions": [{"kind": "fly"}]})",
          R"({"motions": [{}]})",
          R"({"motion": [{"kind": "still"}]})",
          R"({"motions": [{"kind": "still", "pose": "+w"}]})",
          R"({"motions": [{"kind": "still", "pose": "up"}]})",
          R"({"motions": [{"kind": "still", "pose": "+x", "up": [1, 0, 0]}]})",
          R"({"motions": [{"kind": "still", "up": [0, 0, 0]}]})",
          R"({"motions": [{"kind": "still", "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}]})",
          R"({"motions": [{"kind": "still", "rotation": [[1, 0], [0, 1]]}]})",
          R"({"motions": [{"kind": "still", "rotation": 5}]})",
          R"({"motions": [{"kind": "still", "duration_s": -1}]})",
          R"({"motions": [{"kind": "still", "duration_s": 1e300}]})",
          R"({"rate_hz": 0, "motions": [{"kind": "still"}]})",
          R"({"rate_hz": 30.5, "motions": [{"kind": "still"}]})",
          R"({"seed": -1, "motions": [{"kind": "still"}]})",
          R"({"schema": "sixpoint/scenario/2", "motions": [{"kind": "still"}]})",
          R"({"start": "1900-01-01", "motions": [{"kind": "still"}]})",
          R"({"filter": "new", "motions": [{"kind": "still"}]})",
          R"({"unit": 7, "motions": [{"kind": "still"}]})",
          R"({"unit": {"firmware": "beta"}, "motions": [{"kind": "still"}]})",
          R"({"unit": {"constants": {"zero_lsb": [1, 2]}}, "motions": [{"kind": "still"}]})",
          R"({"unit": {"constants": {"zero_lsb": [1, 2, 9999]}}, "motions": [{"kind": "still"}]})",
          R"({"unit": {"constants": {"positive_lsb": [1, 1, 1], "negative_lsb": [1, 1, 1]}},
               "motions": [{"kind": "still"}]})",
          R"({"effects": [{"name": "gremlins"}], "motions": [{"kind": "still"}]})",
          R"({"effects": [{"name": "tilt", "parameters": {"x": 1}}], "motions": [{"kind": "still"}]})",
      }) {
    SCOPED_TRACE(text);
    EXPECT_FAILS(parse_scenario(text), ErrorCode::configuration);
  }
}

// Oracle: the defaults that docs/scenario.md states.
TEST(ScenarioJson, WhatIsLeftOutHasTheManualsDefaults) {
  const auto scenario = parse_scenario(R"({"motions": [{"kind": "still"}, {"kind": "shaker"}]})");
  ASSERT_OK(scenario);
  EXPECT_EQ(scenario->seed, 1U);
  EXPECT_EQ(scenario->rate_hz, 30);
  EXPECT_FALSE(scenario->wide) << "activity records";
  EXPECT_EQ(scenario->start, *parse_iso8601("2015-04-09T14:04:00Z"));
  EXPECT_EQ(scenario->temperature_c, 25);
  EXPECT_EQ(scenario->gravity_g, 1);
  EXPECT_EQ(scenario->turn_s, 2);
  EXPECT_FALSE(scenario->filter);
  EXPECT_FALSE(scenario->protocol);
  EXPECT_TRUE(scenario->effects.empty());
  EXPECT_EQ(scenario->unit.firmware, "1.5.0");
  EXPECT_TRUE(scenario->unit.serial.starts_with("MOS2")) << scenario->unit.serial;
  EXPECT_EQ(scenario->unit.noise_mg, (PerAxis<double>{3.9, 3.9, 5.5}));
  EXPECT_EQ(scenario->unit.accel_scale_lsb_per_g, 256);
  EXPECT_EQ(scenario->motions[0].duration_s, 60);
  EXPECT_EQ(scenario->motions[0].rotation, Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
  EXPECT_EQ(scenario->motions[1].tone.frequency_hz, 5);
  EXPECT_EQ(scenario->motions[1].tone.amplitude_g, 0.5);
  EXPECT_EQ(scenario->motions[1].tone.phase_rad, 0);
}

// Oracle: docs/scenario.md: the named axis, or the given direction, points up (the laboratory's z).
TEST(ScenarioJson, APoseIsNamedOrGivenAsDirectionOrRotation) {
  const auto scenario = parse_scenario(R"({"motions": [{"kind": "still", "pose": "-y"},
      {"kind": "still", "up": [3, 0, -4]},
      {"kind": "still", "rotation": [[0, 0, 1], [1, 0, 0], [0, 1, 0]]}]})");
  ASSERT_OK(scenario);
  const auto up = [&](std::size_t i) -> Eigen::Vector3d {
    return scenario->motions[i].rotation * Eigen::Vector3d::UnitZ();
  };
  EXPECT_LT((up(0) - Eigen::Vector3d(0, -1, 0)).norm(), 1e-12);
  EXPECT_LT((up(1) - Eigen::Vector3d(0.6, 0, -0.8)).norm(), 1e-12);
  EXPECT_EQ(up(2), Eigen::Vector3d(1, 0, 0));
}

TEST(ScenarioJson, AnErrorNamesThePathOfItsKey) {
  const struct {
    const char* json;
    const char* path;
  } rows[] = {
      {R"({"motion": []})", "/motion"},
      {R"({"motions": [{"kind": "still"}, {"kind": "still", "duration": 3}]})",
       "/motions/1/duration"},
      {R"({"motions": [{"kind": "still", "duration_s": "long"}]})", "/motions/0/duration_s"},
      {R"({"unit": {"sensor": {"legacy": {"zero_lsb": [1, 2]}}}, "motions": [{"kind": "still"}]})",
       "/unit/sensor/legacy/zero_lsb"},
      {R"({"effects": [{"name": "tilt", "parameters": {"angle_deg": "1"}}],
           "motions": [{"kind": "still"}]})",
       "/effects/0/parameters/angle_deg"},
      {R"({"effects": [{"name": "drift"}, {"name": "tilt", "parameters": {"deg": 1}}],
           "motions": [{"kind": "still"}]})",
       "/effects/1/parameters/deg"},
      {R"({"population": {"effects": [{"name": "drift", "mean": {"mg": 1}}]},
           "motions": [{"kind": "still"}]})",
       "/population/effects/0/mean/mg"},
      {R"({"effects": [{"name": "bandwidth", "parameters": {"corner_hz": -5}}],
           "motions": [{"kind": "still"}]})",
       "/effects/0/parameters/corner_hz"},
      {R"({"population": {"effects": [{"name": "seating", "mean": {"sd_deg": -1}}]},
           "motions": [{"kind": "still"}]})",
       "/population/effects/0/mean/sd_deg"},
      {R"({"start": "2015-04-09T14:04:00.5Z", "motions": [{"kind": "still"}]})", "/start"},
      {R"({"start": "2106-02-07T06:28:00Z", "motions": [{"kind": "still"}]})", "/start"},
      {R"({"motions": [{"kind": "still", "duration_s": 0.5}]})", "/motions"},
      {R"({"protocol": [{"first_sample": 0, "samples": 100}, {"first_sample": 50, "samples": 9}]})",
       "/protocol/1/first_sample"},
      {R"({"protocol": "production", "motions": []})", "/motions"},
      {R"({"protocol": "production", "unit": {"sensor": {}}})", "/unit/sensor"},
      {R"({"protocol": "quick"})", "/protocol"},
      {R"({"motions": [{"kind": "still", "duration_s": 3, "duration_s": 4}]})",
       "/motions/0/duration_s"},
      {R"({"motions": [{"kind": "still"}], "motions": [{"kind": "still"}]})", "/motions"},
      {R"({"protocol": "production", "temperature": [[0, 20], [0, 21]]})", "/temperature"},
      {R"({"seating_sd_deg": 0.1, "motions": [{"kind": "still"}]})", "/seating_sd_deg"},
  };
  for (const auto& row : rows) {
    const auto scenario = parse_scenario(row.json);
    EXPECT_FAILS(scenario, ErrorCode::configuration);
    const std::string path = row.path;
    EXPECT_EQ(scenario.error().where, path.empty() ? "scenario" : "scenario: " + path) << row.json;
    EXPECT_THAT(scenario.error().hint, HasSubstr("docs/scenario.md"));
  }
}

TEST(ScenarioJson, AnEffectThatIsNoneIsNamedWithItsPath) {
  for (
      const auto& [json, path] :
      {std::pair(
           R"({"effects": [{"name": "drift"}, {"name": "tillt"}], "motions": [{"kind": "still"}]})",
           "scenario: /effects/1/name"),
       {R"({"population": {"effects": [{"name": "tillt"}]}, "motions": [{"kind": "still"}]})",
        "scenario: /population/effects/0/name"}}) {
    const auto scenario = parse_scenario(json);
    EXPECT_FAILS(scenario, ErrorCode::configuration);
    EXPECT_EQ(scenario.error().where, path);
    EXPECT_THAT(scenario.error().hint, HasSubstr("tilt"));
  }
}

// The rows of impossible()'s table, each with its limits.
TEST(ScenarioJson, NumbersThatCannotBeAreTold) {
  const auto parameter = [](const char* effect, std::string_view name) -> const Parameter& {
    const auto& all = (*find_effect(effect))->parameters;
    return *std::ranges::find(all, name, &Parameter::name);
  };
  struct Row {
    const Parameter& parameter;
    std::vector<double> possible;
    std::vector<double> not_possible;
    const char* words;
  };
  const std::vector<Row> rows = {
      {parameter("bandwidth", "order"), {1, 2, 8}, {0, 9, 2.5, -1}, "whole, from 1 to 8"},
      {parameter("axis_rotation", "matrix"), {-1, 0, 1}, {0.5, 2, -2}, "whole, from -1 to 1"},
      {parameter("bandwidth", "corner_hz"),
       {0.01, 5000},
       {0, -5, 5001},
       "above 0 and at most 5000"},
      {parameter("seating", "sd_deg"), {0, 50}, {-0.1, 51}, "from 0 to 50"},
      {parameter("clock_error", "ppm"), {-5e5, 5e5}, {-1e6, 1e6}, "from -500000 to 500000"},
      {parameter("dropped_samples", "rate"), {0, 1}, {-0.1, 1.1}, "from 0 to 1"},
      {parameter("non_orthogonality", "yz_xz_xy"), {-1, 1}, {-1.1, 1.1}, "from -1 to 1"},
      {parameter("filter_mismatch", "gain"), {0.5, 2}, {0, -1}, "above 0 and at most 130"}};
  for (const Row& row : rows) {
    SCOPED_TRACE(row.parameter.name);
    EXPECT_EQ(impossible(row.parameter, row.possible), std::nullopt);
    for (const double x : row.not_possible) {
      EXPECT_EQ(impossible(row.parameter, {row.possible[0], x}), row.words) << x;
    }
  }
  const Parameter& matrix = parameter("axis_rotation", "matrix");
  EXPECT_EQ(impossible(matrix, {0, 0, -1, 1, 0, 0, 0, 1, 0}), std::nullopt);
  for (const std::vector<double>& axes :
       {std::vector<double>(9, 0.0), {1, 0, 0, 1, 0, 0, 0, 0, 1}, {1, 1, 0, 0, 1, 0, 0, 0, 1}}) {
    EXPECT_EQ(impossible(matrix, axes), "0 but for one of each row and column");
  }
}

// Oracle: the keys of a bundle's protocol.json, each with a value of its own.
TEST(ScenarioJson, AProtocolIsReadAsABundleHasIt) {
  const auto scenario = parse_scenario(R"({"seed": 5, "gravity_g": 0.999, "seating_sd_deg": 0.02,
      "unit": {"gain": [1.01, 0.99, 1.02], "offset_g": [0.02, -0.03, 0], "noise_mg": [4, 5, 6]},
      "protocol": [
        {"name": "faces", "kind": "still", "first_sample": 0, "samples": 1000, "host_start_s": 32.5,
         "rotation": [[0, 0, 1], [1, 0, 0], [0, 1, 0]], "temperature_c": 23},
        {"name": "shaker", "kind": "vibration", "first_sample": 1000, "samples": 500,
         "host_start_s": 60, "temperature_c": [20, 21],
         "vibration": {"direction_lab": [0, 0, 1], "frequency_hz": 7, "amplitude_g": 0.8,
                       "phase_rad": 1.5}}],
      "temperature": [[0.5, 22.5], [100, 24]],
      "effects": [{"name": "drift", "parameters": {"mg_per_h": [1, 2, 3]}}]})");
  ASSERT_OK(scenario);
  ASSERT_TRUE(scenario->protocol);
  const ProtocolRun& run = *scenario->protocol;
  EXPECT_EQ(run.rate_hz, 100) << "of a protocol";
  EXPECT_EQ(run.seed, 5U);
  EXPECT_EQ(run.gravity_g, 0.999);
  EXPECT_EQ(run.seating_sd_deg, 0.02);
  EXPECT_EQ(run.gain, (PerAxis<double>{1.01, 0.99, 1.02}));
  EXPECT_EQ(run.offset_g, (PerAxis<double>{0.02, -0.03, 0}));
  EXPECT_EQ(run.noise_mg, (PerAxis<double>{4, 5, 6}));
  EXPECT_EQ(scenario->unit.firmware, "1.9.2");
  EXPECT_TRUE(scenario->wide) << "16-bit records";
  ASSERT_EQ(run.segments.size(), 2U);
  EXPECT_EQ(run.segments[0].name, "faces");
  EXPECT_EQ(run.segments[0].kind, SegmentKind::still);
  EXPECT_EQ(run.segments[0].host_start_s, 32.5);
  EXPECT_EQ(run.segments[0].rotation.col(2), Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(run.segments[0].commanded_c, (std::array<double, 2>{23, 23}));
  EXPECT_FALSE(run.segments[0].vibration);
  EXPECT_EQ(run.segments[1].first_sample, 1000U);
  EXPECT_EQ(run.segments[1].commanded_c, (std::array<double, 2>{20, 21}));
  ASSERT_TRUE(run.segments[1].vibration);
  EXPECT_EQ(run.segments[1].vibration->frequency_hz, 7);
  EXPECT_EQ(run.segments[1].vibration->amplitude_g, 0.8);
  EXPECT_EQ(run.segments[1].vibration->phase_rad, 1.5);
  ASSERT_EQ(run.temperature.size(), 2U);
  EXPECT_EQ(run.temperature[1].host_time_s, 100);
  EXPECT_EQ(run.temperature[1].temperature_c, 24);
  ASSERT_EQ(run.effects.size(), 1U);
  EXPECT_EQ(run.effects[0].values.at("mg_per_h"), (std::vector<double>{1, 2, 3}));
}

// A bundle that 'simulate' makes is one that 'gap diagnose' takes: the limits are those of
// gap/recording/protocol.cpp. The last value that is taken beside the first that is not.
TEST(ScenarioJson, AProtocolHasTheLimitsOfABundle) {
  const auto with = [](const std::string& segment, const std::string& top = "") {
    return parse_scenario(
        fmt::format(R"({{"protocol": [{{"first_sample": 0, "samples": 10{}}}]{}}})", segment, top));
  };
  for (const char* gravity_g : {"0.99", "1.01"}) {
    EXPECT_OK(with("", fmt::format(R"(, "gravity_g": {})", gravity_g)));
  }
  for (const char* gravity_g : {"0.989", "1.011", "0", "9.81"}) {
    EXPECT_FAILS(with("", fmt::format(R"(, "gravity_g": {})", gravity_g)),
                 ErrorCode::configuration);
  }
  EXPECT_OK(
      parse_scenario(R"({"gravity_g": 9.8, "motions": [{"kind": "still", "duration_s": 2}]})"))
      << "no protocol, no bundle";
  EXPECT_OK(with(R"(, "temperature_c": [-100, 200])"));
  EXPECT_FAILS(with(R"(, "temperature_c": -101)"), ErrorCode::configuration);
  EXPECT_FAILS(with(R"(, "temperature_c": [20, 201])"), ErrorCode::configuration);
  EXPECT_OK(with(R"(, "kind": "vibration", "vibration": {"frequency_hz": 0.001})"));
  EXPECT_FAILS(with(R"(, "kind": "vibration", "vibration": {"frequency_hz": 0})"),
               ErrorCode::configuration);
  EXPECT_FAILS(with(R"(, "kind": "vibration")"), ErrorCode::configuration);
  const auto of_segments = [](int count) {
    std::string list;
    for (int i = 0; i < count; ++i) {
      list += fmt::format(R"({}{{"first_sample": {}, "samples": 10}})", i == 0 ? "" : ",", 10 * i);
    }
    return parse_scenario("{\"protocol\": [" + list + "]}");
  };
  EXPECT_OK(of_segments(1000));
  EXPECT_FAILS(of_segments(1001), ErrorCode::configuration);
}

// Oracle: docs/scenario.md: a gain of 2 % and an offset of 35 mg, noise within 5 %. Over 300 seeds
// the root mean squares are known to 5 % or so; the draws are cut at 2.5 standard deviations.
TEST(ScenarioJson, AProtocolsUnitIsDrawnAsTheManualSays) {
  double gain2 = 0;
  double offset2 = 0;
  constexpr int kUnits = 300;
  for (int seed = 1; seed <= kUnits; ++seed) {
    const auto scenario = parse_scenario(
        fmt::format(R"({{"seed": {}, "protocol": [{{"first_sample": 0, "samples": 10}}]}})", seed));
    ASSERT_OK(scenario);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      gain2 += std::pow(scenario->protocol->gain[axis] - 1, 2) / (3 * kUnits);
      offset2 += std::pow(scenario->protocol->offset_g[axis], 2) / (3 * kUnits);
      EXPECT_NEAR(scenario->protocol->noise_mg[axis] / (axis == 2 ? 5.5 : 3.9), 1, 0.05);
    }
  }
  EXPECT_NEAR(std::sqrt(gain2), 0.02, 0.002);
  EXPECT_NEAR(std::sqrt(offset2), 0.035, 0.0035);
}

// Closed form: of a white density, the variance of a sample is proportional to the rate.
TEST(ScenarioJson, NoiseOfAProtocolHasOneDensityAtEveryRate) {
  for (const int rate_hz : {20, 30, 50, 90}) {
    const auto scenario = parse_scenario(fmt::format(
        R"({{"rate_hz": {}, "protocol": [{{"first_sample": 0, "samples": 10}}]}})", rate_hz));
    ASSERT_OK(scenario);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double density = std::pow(scenario->protocol->noise_mg[axis], 2) / rate_hz;
      EXPECT_NEAR(density / (std::pow(axis == 2 ? 5.5 : 3.9, 2) / 100), 1, 0.11) << rate_hz;
    }
  }
}

// One number, three, or three rows of three: docs/scenario.md.
TEST(ScenarioJson, AParameterIsANumberAListOrAMatrix) {
  const auto scenario = parse_scenario(R"({"motions": [{"kind": "still"}], "effects": [
      {"name": "saturation", "parameters": {"level_g": 5.5}},
      {"name": "drift", "parameters": {"mg_per_h": [1, 2, 3]}},
      {"name": "axis_rotation", "parameters": {"matrix": [[0, 1, 0], [0, 0, 1], [1, 0, 0]]}}]})");
  ASSERT_OK(scenario);
  EXPECT_EQ(scenario->effects[0].values.at("level_g"), std::vector<double>{5.5});
  EXPECT_EQ(scenario->effects[1].values.at("mg_per_h"), (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(scenario->effects[2].values.at("matrix"),
            (std::vector<double>{0, 1, 0, 0, 0, 1, 1, 0, 0}));
  EXPECT_FAILS(parse_scenario(R"({"motions": [{"kind": "still"}], "effects": [
      {"name": "drift", "parameters": {"mg_per_h": [1, 2]}}]})"),
               ErrorCode::configuration);
}

}  // namespace
}  // namespace sixpoint::sim
