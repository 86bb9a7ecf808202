#include "gap/adopt/evidence.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "gap/report/made_diagnosis.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::ordered_json;

Json made_answer() {
  Json json = Json::parse(R"({
    "schema": "sixpoint/gap-diagnose/1", "serial": "U1", "protocol": "engineering",
    "inconclusive": false, "seconds": 0.3,
    "effects": [
      {"name": "tilt", "probability": 0.99, "confounded_with": [],
       "parameters": {"rotation_vector_deg": [0.1, 0.2, 0], "angle_deg": 0.22},
       "standard_uncertainty": {"rotation_vector_deg": [0.01, 0.01, 0], "angle_deg": 0.01}},
      {"name": "local_gravity", "probability": 0.95, "confounded_with": ["gain"],
       "parameters": {"ratio": 1.001}, "standard_uncertainty": {"ratio": 0.0001}}],
    "candidates": [
      {"name": "tilt", "probability": 0.99, "confounded_with": [],
       "parameters": {"rotation_vector_deg": [0.1, 0.2, 0]},
       "standard_uncertainty": {"rotation_vector_deg": [0.01, 0.01, 0]}},
      {"name": "drift", "probability": 0.2, "confounded_with": [],
       "parameters": {"mg_per_h": [0.1, 0, 0]}, "standard_uncertainty": {"mg_per_h": [0.1, 0.1, 0.1]}},
      {"name": "third_order", "probability": 0.03, "confounded_with": [], "parameters": {},
       "standard_uncertainty": {}},
      {"name": "filter_mismatch", "probability": 0.01, "confounded_with": [],
       "parameters": {"gain": 0.99}, "standard_uncertainty": {"gain": 0.01}}],
    "not_observable": [{"name": "wrap", "needs_segment": "shaker_high"}],
    "unknown": {"present": false, "probability": 0.03}})");
  return json;
}

TEST(Evidence, IsWhatADocumentSays) {
  const auto read = read_evidence(made_answer().dump(), "a.json");
  ASSERT_OK(read);
  EXPECT_EQ(read->serial, "U1");
  EXPECT_EQ(read->source, "a.json");
  EXPECT_EQ(read->not_observable, std::vector<std::string>{"wrap"});
  ASSERT_EQ(read->effects.size(), 3U) << "tilt, local_gravity, and the size of drift";
  EXPECT_TRUE(read->effects[0].named);
  ASSERT_EQ(read->effects[0].parameters.size(), 1U) << "the angle follows from the vector";
  EXPECT_FALSE(read->effects[1].named) << "looks like the gain";
  EXPECT_EQ(read->effects[2].name, "drift");
  EXPECT_FALSE(read->effects[2].named);
  EXPECT_EQ(read->effects[2].parameters[0].sd, std::vector<double>(3, 0.1));
}

TEST(Evidence, TheIdIsThatOfTheContent) {
  Json other = made_answer();
  other["seconds"] = 99;
  const auto a = read_evidence(made_answer().dump(), "a.json");
  const auto b = read_evidence(other.dump(2), "b.json");
  other["effects"][0]["parameters"]["rotation_vector_deg"][0] = 0.11;
  const auto c = read_evidence(other.dump(), "a.json");
  ASSERT_OK(a);
  ASSERT_OK(b);
  ASSERT_OK(c);
  EXPECT_EQ(a->id, b->id);
  EXPECT_NE(a->id, c->id);
  EXPECT_EQ(a->id.size(), 64U);
}

TEST(Evidence, OfADiagnosisIsThatOfItsAnswer) {
  const Diagnosis diagnosis = tests::diagnosed_as("U7");
  Json answer = {{"schema", "sixpoint/gap-diagnose/1"}};
  answer.update(diagnosis.to_json());
  const auto read = read_evidence(answer.dump(), "x");
  ASSERT_OK(read);
  EXPECT_EQ(read->id, evidence_of(diagnosis).id);
  EXPECT_EQ(read->serial, "U7");
}

TEST(Evidence, ComesBackFromAScenario) {
  const auto read = read_evidence(made_answer().dump(), "a.json");
  ASSERT_OK(read);
  Json kept = Json::parse(to_json(*read).dump(2));
  const auto again = evidence_from_scenario(kept);
  ASSERT_OK(again);
  EXPECT_EQ(to_json(*again), to_json(*read));
  kept["effects"][0]["parameters"]["rotation_vector_deg"][0] = 0.3;
  EXPECT_FAILS(evidence_from_scenario(kept), ErrorCode::bad_data);  // changed by hand
  kept.erase("serial");
  EXPECT_FAILS(evidence_from_scenario(kept), ErrorCode::bad_data);
}

// What units share is kept apart; documents of earlier versions, which have no such key, stay as they
// are. A number that nothing shows has no uncertainty.
TEST(Evidence, KeepsWhatUnitsShare) {
  const auto earlier = read_evidence(made_answer().dump(), "a.json");
  ASSERT_OK(earlier);
  EXPECT_FALSE(to_json(*earlier)["effects"][0].contains("form_uncertainty"));
  Json answer = made_answer();
  answer["effects"][0]["form_uncertainty"] = {{"rotation_vector_deg", {0.005, 0.01, 0}}};
  answer["effects"][0]["standard_uncertainty"]["rotation_vector_deg"] = {0.01, 0.02, nullptr};
  const auto read = read_evidence(answer.dump(), "a.json");
  ASSERT_OK(read);
  const NamedValue& turn = read->effects[0].parameters[0];
  EXPECT_EQ(turn.form_sd, (std::vector<double>{0.005, 0.01, 0}));
  EXPECT_EQ(turn.sd, (std::vector<double>{0.01, 0.02, 0}));
  const auto again = evidence_from_scenario(to_json(*read));
  ASSERT_OK(again);
  EXPECT_EQ(again->effects[0].parameters[0].form_sd, turn.form_sd);
}

TEST(Evidence, RefusesWhatIsNoDiagnosis) {
  const auto refused = [](const Json& json) {
    EXPECT_FAILS(read_evidence(json.dump(), "x.json"), ErrorCode::bad_data);
  };
  refused(Json::array());
  refused({{"schema", "sixpoint/scenario/1"}});
  for (const char* key : {"serial", "effects", "candidates", "unknown", "not_observable"}) {
    SCOPED_TRACE(key);
    Json without = made_answer();
    without.erase(key);
    refused(without);
  }
  Json nameless = made_answer();
  nameless["serial"] = "";
  refused(nameless);
  nameless["bundle"] = "data/table.csv";
  const auto table = read_evidence(nameless.dump(), "x");
  ASSERT_OK(table);
  EXPECT_EQ(table->serial, "table.csv") << "a table of readings stands for a unit";
  Json wrong = made_answer();
  wrong["effects"][0]["probability"] = Json::object();
  EXPECT_OK(read_evidence(wrong.dump(), "x")) << "counts as 0";
  wrong["effects"] = 7;
  refused(wrong);
  EXPECT_FAILS(read_evidence("{", "x"), ErrorCode::bad_data);
}

// An effect whose numbers are not numbers has none.
TEST(Evidence, NumbersThatAreNoneAreLeftOut) {
  Json odd = made_answer();
  odd["effects"][0]["parameters"]["rotation_vector_deg"] = {1, "x", nullptr};
  odd["effects"][1]["parameters"]["ratio"] = std::vector<double>(40, 1);
  const auto read = read_evidence(odd.dump(), "x");
  ASSERT_OK(read);
  EXPECT_TRUE(read->effects[0].parameters.empty());
  EXPECT_TRUE(read->effects[1].parameters.empty());
}

}  // namespace
}  // namespace sixpoint::gap
