// gap score and gap answers: from exported bundles to scores, by this project's methods and by a
// program that knows nothing of it.
#include <filesystem>
#include <fstream>

#include "cli/command_fixture.h"

namespace sixpoint::cli {
namespace {

class GapScore : public tests::CommandTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(run({"gap", "challenge", "--export", path("a"), "--labels", path("l.jsonl"),
                   "--trials", "8", "--seed", "12", "--protocol", "production", "--none", "0.25",
                   "--outside", "0.25"})
                  .exit_code,
              0);
  }
  static double measure(const nlohmann::ordered_json& json, const std::string& name) {
    for (const auto& one : json["measures"]) {
      if (one["name"] == name) {
        return one["value"].is_null() ? -1 : one["value"].get<double>();
      }
    }
    return -2;
  }
  tests::Answer score(const std::string& answers) {
    return run({"gap", "score", path(answers), "--labels", path("l.jsonl"), "--json"});
  }
};

// Answers made from the labels themselves are perfect; the sealed labels do what they promise.
TEST_F(GapScore, APerfectAnswerIsPerfect) {
  std::ifstream labels(path("l.jsonl"));
  std::ofstream answers(path("perfect.jsonl"));
  std::string line;
  std::getline(labels, line);
  while (std::getline(labels, line)) {
    const auto label = nlohmann::ordered_json::parse(line);
    const bool outside = label["kind"] == "outside";
    nlohmann::ordered_json answer;
    answer["bundle"] = label["bundle"];
    answer["effects"] = nlohmann::ordered_json::array();
    for (const auto& effect : label["effects"]) {
      if (!outside) {
        answer["effects"].push_back({{"name", effect["name"]}, {"probability", 1}});
      }
    }
    answer["unknown"] = {{"present", outside}, {"probability", outside ? 1 : 0}};
    answer["unknown"]["where"] = label["where"];
    answers << answer.dump() << '\n';
  }
  answers.close();
  const auto scored = score("perfect.jsonl");
  ASSERT_EQ(scored.exit_code, 0) << scored.people;
  EXPECT_EQ(run({"gap", "score", "--labels", path("l.jsonl")}).exit_code, 64);
  EXPECT_EQ(run({"gap", "score", "--help"}).out.find("--answers TEXT REQUIRED"), std::string::npos);
  EXPECT_EQ(run({"gap", "score", "--labels", path("l.jsonl"), "--answers", path("perfect.jsonl"),
                 "--json"})
                .out,
            scored.out)
      << "the contract's form";
  const auto json = scored.json();
  EXPECT_EQ(json["schema"], "sixpoint/gap-score/1");
  EXPECT_EQ(json["missing"], 0);
  EXPECT_EQ(measure(json, "open_auc"), 1);
  EXPECT_EQ(measure(json, "oscr"), 1);
  EXPECT_EQ(measure(json, "f1"), 1);
  EXPECT_EQ(measure(json, "exact_set"), 1);
  EXPECT_EQ(measure(json, "unknown_calibration"), 0);
  EXPECT_EQ(measure(json, "top_label_calibration"), 0);
  EXPECT_EQ(measure(json, "outside_honest"), 1);
  EXPECT_EQ(json["power"].size(), 10U);
}

// A folder of what `gap diagnose --json` wrote, one document missing, and JSON Lines by the
// project's methods, are scored alike.
TEST_F(GapScore, DocumentsOfDiagnoseAndMethodsOfTheProject) {
  std::filesystem::create_directories(path("answers"));
  std::ifstream file(path("a/challenge.json"));
  const auto list = nlohmann::json::parse(file);
  for (std::size_t i = 1; i < list["bundles"].size(); ++i) {
    const std::string name = list["bundles"][i];
    std::ofstream(path("answers/" + name + ".json"))
        << run({"gap", "diagnose", path("a/" + name), "--json"}).out;
  }
  const auto documents = score("answers");
  ASSERT_EQ(documents.exit_code, 0) << documents.people;
  EXPECT_EQ(documents.json()["missing"], 1);

  for (const char* method : {"diagnose", "closed-world", "sequential"}) {
    const std::string name = std::string(method) + ".jsonl";
    const auto made =
        run({"gap", "answers", path("a"), "--method", method, "-o", path(name), "--json"});
    ASSERT_EQ(made.exit_code, 0) << made.people;
    EXPECT_EQ(made.json()["bundles"], 8);
    EXPECT_EQ(made.json()["failed"], 0);
    const auto scored = score(name);
    ASSERT_EQ(scored.exit_code, 0) << scored.people;
    EXPECT_EQ(scored.json()["missing"], 0);
    if (std::string_view(method) == "closed-world") {
      EXPECT_EQ(measure(scored.json(), "needless_unknown"), 0);
    }
  }
  const auto text = run({"gap", "score", path("diagnose.jsonl"), "--labels", path("l.jsonl")});
  EXPECT_THAT(text.out, testing::HasSubstr("open_auc"));
  EXPECT_THAT(text.out, testing::HasSubstr("named, by size over the bound"));
}

TEST_F(GapScore, Refusals) {
  const auto dry = run({"gap", "answers", path("a"), "-o", path("x"), "--dry-run", "--json"});
  EXPECT_EQ(dry.exit_code, 0);
  EXPECT_EQ(dry.json()["bundles"], 8);
  EXPECT_FALSE(std::filesystem::exists(path("x")));
  EXPECT_EQ(run({"gap", "answers", path("a"), "--method", "guess", "-o", path("x")}).exit_code, 64);
  EXPECT_EQ(run({"gap", "answers", path("none"), "-o", path("x")}).exit_code, 66);
  EXPECT_EQ(score("none.jsonl").exit_code, 66);
  std::ofstream(path("bad.jsonl")) << "nonsense\n";
  EXPECT_EQ(score("bad.jsonl").exit_code, 65);
  EXPECT_EQ(score("bad.jsonl").json()["error"]["code"], "bad_data");
  std::ofstream(path("strange.jsonl"))
      << R"({"bundle": "b1", "effects": [], "unknown": {"present": true, "probability": 1}})";
  EXPECT_EQ(score("strange.jsonl").exit_code, 65);
  // Folders that are named by somebody else lead nowhere outside.
  std::filesystem::create_directories(path("evil"));
  std::ofstream(path("evil/challenge.json")) << R"({"bundles": ["../a"]})";
  EXPECT_EQ(run({"gap", "answers", path("evil"), "-o", path("x")}).exit_code, 65);
  // A bundle that can't be read has no answer, and the others have theirs.
  std::filesystem::create_directories(path("half"));
  std::ofstream(path("half/challenge.json")) << R"({"bundles": ["b1"]})";
  const auto half = run({"gap", "answers", path("half"), "-o", path("x"), "--json"});
  EXPECT_EQ(half.json()["failed"], 1);
}

}  // namespace
}  // namespace sixpoint::cli
