#include "gap/judge/diagnosis.h"

#include <array>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "gap/explain/catalogue.h"
#include "sim/scenario.h"

namespace sixpoint {
namespace {

using Json = nlohmann::ordered_json;

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

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

gap::EffectFinding named(const char* name, std::vector<std::string> confounded_with = {}) {
  gap::EffectFinding finding;
  finding.name = name;
  finding.confounded_with = std::move(confounded_with);
  return finding;
}

// The sentence for a technician: numbers with two decimals, the advice of the first effect, what
// looks like it. By hand.
TEST(Diagnosis, BriefSaysWhatWasFoundAndHowMuchIsLeft) {
  gap::Diagnosis d;
  d.gap.before_mg = 4.125;
  d.gap.after_mg = 0.301;
  d.gap.floor_mg = 0.25;
  d.gap.closed_fraction = 0.99;
  EXPECT_THAT(d.brief(), AllOf(HasSubstr("no gap"), HasSubstr("4.12 mg"), HasSubstr("0.25 mg")));
  d.verdict = gap::Verdict::explained;
  d.effects = {named("tilt", {"misalignment", "seating"})};
  EXPECT_EQ(d.brief(),
            "tilt (or misalignment, seating) explains the gap: 4.12 mg -> 0.30 mg (floor 0.25 mg); "
            "level the jig's base");
  d.effects.push_back(named("drift"));
  EXPECT_THAT(d.brief(), StartsWith("tilt (or misalignment, seating) and drift explain the gap:"));
  d.verdict = gap::Verdict::partly_explained;
  d.unknown.why = {"mean: the zero moves", "codes"};
  EXPECT_THAT(d.brief(), AllOf(HasSubstr("a part of the gap"), EndsWith("mean: the zero moves")));
  d.verdict = gap::Verdict::unexplained;
  EXPECT_THAT(d.brief(), AllOf(HasSubstr("nothing in the catalogue"), Not(HasSubstr("tilt")),
                               EndsWith("mean: the zero moves")));
}

// What is drawn anew at every placement cannot be predicted; a drift can.
TEST(Diagnosis, ScatterOfTheCatalogueIsCalledIrreducible) {
  for (const char* name : {"seating", "random_walk", "flicker"}) {
    gap::Diagnosis d;
    d.verdict = gap::Verdict::explained;
    d.effects = {named(name)};
    EXPECT_THAT(d.brief(), HasSubstr("irreducible")) << name;
    d.gap.closed_fraction = 0.5;
    EXPECT_THAT(d.brief(), Not(HasSubstr("irreducible"))) << "a part of it was predicted";
  }
  gap::Diagnosis drift;
  drift.verdict = gap::Verdict::explained;
  drift.effects = {named("drift")};
  EXPECT_THAT(drift.brief(), Not(HasSubstr("irreducible")));
}

TEST(Diagnosis, NothingCanBeSaidAndWhy) {
  gap::Diagnosis d;
  EXPECT_TRUE(d.usable());
  d.inconclusive = true;
  EXPECT_FALSE(d.usable());
  EXPECT_THAT(d.brief(), HasSubstr("too little data"));
  d.losses = {"no temperature log", "all samples are clipped"};
  EXPECT_THAT(d.brief(), EndsWith("all samples are clipped"));
}

// A number stays a number, three are a vector, nine a matrix in rows; JSON has no infinity.
TEST(Diagnosis, DocumentHoldsNumbersInTheirShape) {
  gap::Diagnosis d;
  gap::EffectFinding finding = named("bandwidth");
  finding.probability = std::numeric_limits<double>::quiet_NaN();
  finding.nats = 12.5;
  finding.parameters = {{"corner_hz", {24}, {0.5}},
                        {"vector", {1, std::numeric_limits<double>::infinity(), 3}, {}},
                        {"matrix", {1, 2, 3, 4, 5, 6, 7, 8, 9}, {}}};
  d.candidates = {finding};
  d.gap.after_interval_mg = {0.25, 0.5};
  d.gap.by_feature[3] = {7, 2};
  d.where = {{2, "soak", "temperature", 1.5, 9}};
  d.unknown.where = {{1, "ramp_up", "temperature"}};
  d.unknown.why = {"mean: the zero moves"};
  d.not_observable = {{"wrap", "shaker_full_scale"}};
  const Json json = d.to_json();
  const Json& found = json["candidates"][0];
  EXPECT_EQ(found["probability"], nullptr);
  EXPECT_EQ(found["evidence_nats"], 12.5);
  EXPECT_EQ(found["parameters"]["corner_hz"], 24);
  EXPECT_EQ(found["parameters"]["vector"], Json::array({1.0, nullptr, 3.0}));
  EXPECT_EQ(found["parameters"]["matrix"], Json::parse("[[1.0,2.0,3.0],[4.0,5.0,6.0],[7,8,9]]"));
  EXPECT_EQ(found["standard_uncertainty"], Json::parse(R"({"corner_hz": 0.5})"));
  EXPECT_EQ(json["gap"]["after"]["interval_mg"], Json::array({0.25, 0.5}));
  EXPECT_EQ(json["gap"]["by_feature"]["codes"]["before_sigma"], 7);
  EXPECT_EQ(json["gap"]["by_feature"]["codes"]["after_sigma"], 2);
  EXPECT_EQ(json["where"][0]["axis"], "Z");
  EXPECT_EQ(json["where"][0]["segment"], "soak");
  EXPECT_EQ(json["unknown"]["where"],
            Json::parse(R"([{"axis": "Y", "segment": "ramp_up", "factor": "temperature"}])"));
  EXPECT_EQ(json["unknown"]["why"], Json::array({"mean: the zero moves"}));
  EXPECT_EQ(json["not_observable"][0]["needs_segment"], "shaker_full_scale");
  EXPECT_TRUE(json["effects"].empty());
}

// What the unit is goes into the simulator as it was found. The angle of a tilt follows from its
// vector: given to the simulator it would scale the vector (sim/effects/tilt.cpp), 0 leaves it
// alone.
TEST(Diagnosis, AugmentedScenarioHoldsTheUnitAndNothingDerived) {
  gap::Diagnosis d;
  d.protocol = "other";
  d.serial = "MOS2A45130007";
  d.seed = 77;
  d.unit.gain = {1.01, 0.98, 1};
  d.unit.offset_g = {0.01, -0.02, 0.03};
  d.unit.noise_mg = {3.9, 3.8, 5.4};
  d.effects = {named("tilt")};
  d.effects[0].parameters = {{"rotation_vector_deg", {0.1, 0.2, 0}, {}}, {"angle_deg", {0.22}, {}}};
  const auto scenario = sim::parse_scenario(gap::augmented_scenario(d).dump());
  ASSERT_OK(scenario);
  EXPECT_EQ(scenario->seed, 77U);
  ASSERT_TRUE(scenario->protocol);
  EXPECT_EQ(scenario->protocol->gain, (std::array<double, 3>{1.01, 0.98, 1}));
  EXPECT_EQ(scenario->protocol->offset_g, (std::array<double, 3>{0.01, -0.02, 0.03}));
  ASSERT_EQ(scenario->protocol->effects.size(), 1U);
  EXPECT_EQ(scenario->protocol->effects[0].values.at("rotation_vector_deg"),
            (std::vector<double>{0.1, 0.2, 0}));
  EXPECT_EQ(scenario->protocol->effects[0].values.at("angle_deg"), std::vector<double>{0});
}

// The labels of the practice bundles say relative_per_c and f0_hz where the simulator's settings
// are percent_per_c and frequency_hz: the answer has both, the scenario only its own.
TEST(Diagnosis, AnswersHaveTheNamesOfTheLabelsToo) {
  gap::Diagnosis d;
  d.protocol = "other";
  d.serial = "MOS2A45130007";
  d.unit.noise_mg = {3.9, 3.9, 5.5};
  d.effects = {named("sensitivity_tempco"), named("soft_mount")};
  d.effects[0].parameters = {{"percent_per_c", {0.03, 0.02, -0.01}, {0.004, 0.004, 0.004}}};
  d.effects[1].parameters = {{"frequency_hz", {14}, {0.2}}, {"q", {2}, {0.1}}};
  const nlohmann::ordered_json json = d.to_json();
  const auto& tempco = json.at("effects").at(0);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(tempco.at("parameters").at("relative_per_c").at(i).get<double>(),
                     d.effects[0].parameters[0].value[i] / 100);
    EXPECT_DOUBLE_EQ(tempco.at("standard_uncertainty").at("relative_per_c").at(i).get<double>(),
                     4e-5);
  }
  EXPECT_EQ(tempco.at("parameters").at("percent_per_c").at(0), 0.03);
  const auto& mount = json.at("effects").at(1);
  EXPECT_EQ(mount.at("parameters").at("f0_hz"), 14);
  EXPECT_EQ(mount.at("parameters").at("frequency_hz"), 14);
  const auto scenario = sim::parse_scenario(gap::augmented_scenario(d).dump());
  ASSERT_OK(scenario);
  EXPECT_EQ(json.at("augmented_scenario").dump().find("relative_per_c"), std::string::npos);
}

// Two lines are two effects of the simulator, and one of the answer.
TEST(Diagnosis, FurtherLinesAreEffectsOfTheScenario) {
  gap::Diagnosis d;
  d.serial = "MOS2A45130007";
  d.unit.noise_mg = {3.9, 3.9, 5.5};
  d.effects = {named("floor_vibration")};
  d.effects[0].parameters = {{"vector_mg", {1, 2, 3}, {0.1, 0.1, 0.1}}, {"frequency_hz", {12}, {}}};
  d.effects[0].further_lines = {
      {{"vector_mg", {3, 2, 1}, {0.1, 0.1, 0.1}}, {"frequency_hz", {17}, {}}}};
  const auto scenario = sim::parse_scenario(gap::augmented_scenario(d).dump());
  ASSERT_OK(scenario);
  ASSERT_EQ(scenario->protocol->effects.size(), 2U);
  EXPECT_EQ(scenario->protocol->effects[0].values.at("frequency_hz"), std::vector<double>{12});
  EXPECT_EQ(scenario->protocol->effects[1].kind->name, "floor_vibration");
  EXPECT_EQ(scenario->protocol->effects[1].values.at("vector_mg"), (std::vector<double>{3, 2, 1}));
  const auto json = d.to_json();
  ASSERT_EQ(json["effects"].size(), 1U);
  ASSERT_EQ(json["effects"][0]["further_lines"].size(), 1U);
  EXPECT_EQ(json["effects"][0]["further_lines"][0]["parameters"]["frequency_hz"], 17);
  EXPECT_EQ(json["effects"][0]["further_lines"][0]["standard_uncertainty"]["vector_mg"][0], 0.1);
}

}  // namespace
}  // namespace sixpoint
