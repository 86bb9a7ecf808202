#include "gap/judge/diagnosis.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "gap/explain/catalogue.h"
#include "sim/scenario.h"

namespace sixpoint {
namespace {

using Json = nlohmann::ordered_json;

gap::EffectFinding finding_of(const sim::EffectKind& kind) {
  gap::EffectFinding finding;
  finding.name = kind.name;
  for (const sim::Parameter& parameter : kind.parameters) {
    finding.parameters.push_back({parameter.name, parameter.default_value, {}});
  }
  return finding;
}

TEST(Diagnosis, EveryPairOfTheCatalogueIsAScenario) {
  const auto& kinds = sim::effect_catalogue();
  ASSERT_EQ(kinds.size(), gap::catalogue().size()) << "diagnosis and simulator share the names";
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    ASSERT_NE(gap::find_entry(kinds[i].name), nullptr) << kinds[i].name;
    for (std::size_t k = i; k < kinds.size(); ++k) {
      gap::Diagnosis diagnosis;
      diagnosis.protocol = "production";
      diagnosis.serial = "MOS2A45130007";
      diagnosis.unit.noise_mg = {3.9, 3.9, 5.5};
      diagnosis.effects.push_back(finding_of(kinds[i]));
      if (k != i) {
        diagnosis.effects.push_back(finding_of(kinds[k]));
      }
      const auto scenario = sim::parse_scenario(gap::augmented_scenario(diagnosis).dump());
      ASSERT_OK(scenario) << kinds[i].name << " " << kinds[k].name;
      ASSERT_TRUE(scenario->protocol.has_value());
      EXPECT_EQ(scenario->protocol->effects.size(), k == i ? 1U : 2U);
    }
  }
}

}  // namespace
}  // namespace sixpoint
