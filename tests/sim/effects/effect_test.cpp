#include "sim/effects/effect.h"

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
