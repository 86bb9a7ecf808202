// The key `population` of a scenario.
#include <gtest/gtest.h>

#include "expect_result.h"
#include "sim/scenario.h"

namespace sixpoint::sim {
namespace {

std::string scenario(const std::string& population, const std::string& more = {}) {
  return R"({"protocol": "production", "population": )" + population + more + "}";
}

constexpr const char* kDrift =
    R"({"effects": [{"name": "drift", "mean": {"mg_per_h": [2, 1, 0]},
        "spread": {"mg_per_h": [0.5, 0.5, 0]}, "standard_uncertainty": {"mg_per_h": [0.1, 0.1, 0.1]},
        "units": 6, "bundles": 8}], "adoptions": [], "documents": []})";

TEST(PopulationJson, AUnitIsDrawnFromItsSeed) {
  const auto a = parse_scenario(scenario(kDrift, R"(, "seed": 1, "unit": {"seed": 5})"));
  const auto b = parse_scenario(scenario(kDrift, R"(, "seed": 2, "unit": {"seed": 5})"));
  const auto c = parse_scenario(scenario(kDrift, R"(, "seed": 5)"));
  const auto d = parse_scenario(scenario(kDrift, R"(, "seed": 6)"));
  ASSERT_OK(a);
  ASSERT_OK(b);
  ASSERT_OK(c);
  ASSERT_OK(d);
  ASSERT_EQ(a->effects.size(), 1U);
  EXPECT_EQ(a->effects[0].values, b->effects[0].values) << "the same unit on another day";
  EXPECT_EQ(a->effects[0].values, c->effects[0].values) << "seed stands for unit.seed";
  EXPECT_NE(c->effects[0].values, d->effects[0].values);
  ASSERT_TRUE(a->protocol.has_value());
  EXPECT_EQ(a->protocol->effects.size(), 1U) << "what runs the protocol has it, too";
  EXPECT_EQ(a->population[0].mean.at("mg_per_h"), (std::vector<double>{2, 1, 0}));
}

TEST(PopulationJson, WhatTheScenarioItselfSaysHolds) {
  const auto own = parse_scenario(scenario(
      kDrift, R"(, "effects": [{"name": "drift", "parameters": {"mg_per_h": [9, 9, 9]}}])"));
  ASSERT_OK(own);
  ASSERT_EQ(own->effects.size(), 1U);
  EXPECT_EQ(own->effects[0].values.at("mg_per_h"), (std::vector<double>{9, 9, 9}));
}

TEST(PopulationJson, ASpreadThatIsNotKnownIsNone) {
  const auto one = parse_scenario(scenario(
      R"({"effects": [{"name": "drift", "mean": {"mg_per_h": [2, 1, 0]}, "spread": {"mg_per_h": null}}]})"));
  ASSERT_OK(one);
  EXPECT_EQ(one->effects[0].values.at("mg_per_h"), (std::vector<double>{2, 1, 0}));
}

TEST(PopulationJson, RefusesWhatItDoesNotKnow) {
  for (const char* wrong :
       {"[]", "{}", R"({"effects": 1})", R"({"effects": [], "more": 1})",
        R"({"effects": [{"name": "none"}]})", R"({"effects": [{"name": "drift", "size": 1}]})",
        R"({"effects": [{"name": "drift", "share_of_units": 2}]})",
        R"({"effects": [{"name": "drift", "mean": {"mg": 1}}]})",
        R"({"effects": [{"name": "drift", "mean": 1}]})",
        R"({"effects": [{"name": "drift", "spread": {"mg_per_h": [-1, 0, 0]}}]})",
        R"({"effects": [{"name": "drift"}, {"name": "drift"}]})"}) {
    SCOPED_TRACE(wrong);
    EXPECT_FAILS(parse_scenario(scenario(wrong)), ErrorCode::configuration);
  }
}

}  // namespace
}  // namespace sixpoint::sim
