#include "sim/effects/effect.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include "expect_result.h"

namespace sixpoint::sim {
namespace {

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

// The rows of impossible()'s table, each with its limits.
TEST(Effects, NumbersThatCannotBeAreTold) {
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

}  // namespace
}  // namespace sixpoint::sim
