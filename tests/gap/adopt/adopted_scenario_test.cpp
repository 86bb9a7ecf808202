#include "gap/adopt/adopted_scenario.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gap/adopt/made_evidence.h"
#include "gap/report/made_diagnosis.h"
#include "sim/bundle_writer.h"
#include "sim/scenario.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::ordered_json;
using tests::made_effect;

const UtcTime kMonday = from_unix_seconds(1'400'000'000);
const UtcTime kTuesday = from_unix_seconds(1'400'086'400);

// With an id that fits what it says, as a scenario checks it.
DocumentEvidence document(const std::string& serial, double tempco, bool with_seating = false) {
  Json answer = {{"schema", "sixpoint/gap-diagnose/1"},
                 {"serial", serial},
                 {"protocol", "engineering"},
                 {"inconclusive", false},
                 {"effects", Json::array()},
                 {"candidates", Json::array()},
                 {"not_observable", Json::array()},
                 {"unknown", {{"present", false}}}};
  const auto add = [&](const char* name, const char* parameter, Json value, Json sd) {
    answer["effects"].push_back({{"name", name},
                                 {"probability", 0.99},
                                 {"parameters", {{parameter, std::move(value)}}},
                                 {"standard_uncertainty", {{parameter, std::move(sd)}}}});
  };
  if (tempco != 0) {
    add("offset_tempco", "mg_per_c", {tempco, -tempco, tempco}, {0.01, 0.01, 0.01});
  }
  if (with_seating) {
    add("seating", "sd_deg", 0.1, 0.01);
  }
  const auto read = read_evidence(answer.dump(), serial + ".json");
  EXPECT_OK(read);
  return *read;
}

Json population_of_text(const std::string& text) { return Json::parse(text)["population"]; }

AdoptionChange change_of(const AdoptedScenario& learnt, std::string_view name) {
  for (const AdoptedEffect& effect : learnt.effects) {
    if (effect.decision.name == name) {
      return effect.change;
    }
  }
  return AdoptionChange::none;
}

TEST(AdoptedScenario, ANewOneIsWhatSimulateTakes) {
  const auto learnt = adopt("", {document("A", 0.4), document("B", 0.5)}, kMonday);
  ASSERT_OK(learnt);
  EXPECT_TRUE(learnt->changed);
  EXPECT_EQ(learnt->adoption, 1);
  EXPECT_EQ(change_of(*learnt, "offset_tempco"), AdoptionChange::added);
  const auto scenario = sim::parse_scenario(learnt->text);
  ASSERT_OK(scenario);
  ASSERT_EQ(scenario->population.size(), 1U);
  EXPECT_NEAR(scenario->population[0].mean.at("mg_per_c")[0], 0.45, 1e-9);
  EXPECT_NEAR(scenario->population[0].spread.at("mg_per_c")[0], std::sqrt(0.005 - 0.0001), 1e-9);
  const Json population = population_of_text(learnt->text);
  EXPECT_EQ(population["effects"][0]["units"], 2);
  EXPECT_EQ(population["effects"][0]["bundles"], 2);
  EXPECT_EQ(population["adoptions"][0]["made_at"], "2014-05-13T16:53:20Z");
  EXPECT_EQ(population["documents"][0]["serial"], "A");
  EXPECT_EQ(population["documents"][0]["sha256"].get<std::string>().size(), 64U);
}

// Oracle: the population of all documents at once.
TEST(AdoptedScenario, InTwoStepsItIsTheSameAsInOne) {
  const std::vector<DocumentEvidence> first = {document("A", 0.4), document("B", 0.5)};
  const std::vector<DocumentEvidence> second = {document("C", 0.2), document("A", 0.4)};
  const auto one = adopt("", {first[0], first[1], second[0]}, kMonday);
  const auto two = adopt("", first, kMonday);
  ASSERT_OK(one);
  ASSERT_OK(two);
  const auto three = adopt(two->text, second, kTuesday);
  ASSERT_OK(three);
  EXPECT_EQ(three->new_documents, 1U) << "that of A is there already";
  EXPECT_EQ(change_of(*three, "offset_tempco"), AdoptionChange::changed);
  EXPECT_EQ(population_of_text(three->text)["effects"], population_of_text(one->text)["effects"]);
  const Json adoptions = population_of_text(three->text)["adoptions"];
  ASSERT_EQ(adoptions.size(), 2U);
  EXPECT_EQ(adoptions[0], population_of_text(two->text)["adoptions"][0]) << "history stays";
  EXPECT_EQ(population_of_text(three->text)["documents"][2]["adoption"], 2);
  const auto again = adopt(three->text, second, kTuesday);
  ASSERT_OK(again);
  EXPECT_FALSE(again->changed);
  EXPECT_EQ(again->text, three->text) << "nothing new";
}

TEST(AdoptedScenario, WhatTheScenarioHadStays) {
  const std::string mine = R"({"protocol": "production", "seed": 9,
      "unit": {"gain": [1.01, 1, 1]},
      "effects": [{"name": "tilt"}, {"name": "offset_tempco"}],
      "population": {"effects": [{"name": "seating", "mean": {"sd_deg": 0.03}}]}})";
  const auto learnt = adopt(mine, {document("A", 0.4, true), document("B", 0.5, true)}, kMonday);
  ASSERT_OK(learnt);
  const Json before = Json::parse(mine);
  const Json after = Json::parse(learnt->text);
  for (const char* key : {"protocol", "seed", "unit", "effects"}) {
    EXPECT_EQ(after[key], before[key]) << key;
  }
  EXPECT_EQ(change_of(*learnt, "offset_tempco"), AdoptionChange::kept);
  EXPECT_EQ(change_of(*learnt, "seating"), AdoptionChange::kept);
  EXPECT_EQ(after["population"]["effects"], before["population"]["effects"]);
}

TEST(AdoptedScenario, WhatFurtherUnitsDoNotHaveIsWithdrawn) {
  const auto one = adopt("", {document("A", 0.4)}, kMonday);
  ASSERT_OK(one);
  EXPECT_EQ(population_of_text(one->text)["effects"][0]["spread"]["mg_per_c"], nullptr);
  const auto two = adopt(one->text, {document("B", 0)}, kTuesday);
  ASSERT_OK(two);
  EXPECT_EQ(change_of(*two, "offset_tempco"), AdoptionChange::withdrawn);
  EXPECT_TRUE(population_of_text(two->text)["effects"].empty());
  EXPECT_EQ(population_of_text(two->text)["adoptions"][1]["withdrawn"][0], "offset_tempco");
}

// Units without any effect: what the simulator makes of the scenario stays, byte for byte.
TEST(AdoptedScenario, UnitsWithoutEffectsChangeNothing) {
  const std::string mine = R"({"protocol": "production", "seed": 9})";
  std::vector<DocumentEvidence> plain;
  for (const char* serial : {"A", "B", "C"}) {
    plain.push_back(evidence_of(tests::diagnosed_as(serial)));
  }
  const auto learnt = adopt(mine, plain, kMonday);
  ASSERT_OK(learnt);
  EXPECT_TRUE(population_of_text(learnt->text)["effects"].empty());
  const auto recording = [](const std::string& text) {
    MemoryEnv memory;
    const auto scenario = sim::parse_scenario(text);
    EXPECT_OK(scenario);
    EXPECT_OK(sim::write_bundle(memory.files, "b", *scenario));
    return *read_file(memory.files, "b/recording.gt3x");
  };
  EXPECT_EQ(recording(learnt->text), recording(mine));
}

TEST(AdoptedScenario, HistoryIsThePopulationAfterEachAdoption) {
  const auto one = adopt("", {document("A", 0.4), document("B", 0.5)}, kMonday);
  ASSERT_OK(one);
  const auto two = adopt(one->text, {document("C", 0.9)}, kTuesday);
  ASSERT_OK(two);
  const auto history = adoption_history(two->text);
  ASSERT_OK(history);
  EXPECT_EQ(history->documents.size(), 3U);
  ASSERT_EQ(history->states.size(), 2U);
  EXPECT_EQ(history->states[0].documents, 2U);
  EXPECT_NEAR(history->states[0].population[0].mean.at("mg_per_c")[0], 0.45, 1e-9);
  EXPECT_NEAR(history->states[1].population[0].mean.at("mg_per_c")[0], 0.6, 1e-3);
  EXPECT_EQ(history->states[1].made_at, "2014-05-14T16:53:20Z");
  const auto none = adoption_history(R"({"protocol": "production"})");
  ASSERT_OK(none);
  EXPECT_TRUE(none->states.empty());
}

TEST(AdoptedScenario, RefusesWhatItCannotExtend) {
  EXPECT_FAILS(adopt("{", {}, kMonday), ErrorCode::configuration);
  EXPECT_FAILS(adopt(R"({"none": 1})", {}, kMonday), ErrorCode::configuration);
  EXPECT_FAILS(adopt(R"({"protocol": "production",
                         "population": {"effects": [], "adoptions": [7]}})",
                     {}, kMonday),
               ErrorCode::configuration);
  EXPECT_FAILS(adopt(R"({"protocol": "production",
                         "population": {"effects": [], "adoptions": 7}})",
                     {}, kMonday),
               ErrorCode::configuration);
  const auto learnt = adopt("", {document("A", 0.4)}, kMonday);
  ASSERT_OK(learnt);
  Json changed = Json::parse(learnt->text);
  changed["population"]["documents"][0]["serial"] = "B";
  EXPECT_FAILS(adopt(changed.dump(), {}, kMonday), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::gap
