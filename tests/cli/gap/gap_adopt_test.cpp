// sixpoint gap adopt by its contract; tests/gap/adopt has the rule and the estimator.
#include <filesystem>
#include <fstream>

#include "cli/command_fixture.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::CommandTest;

class GapAdopt : public CommandTest {
 protected:
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name)) << text;
  }
  std::string read(const std::string& name) const {
    std::ifstream in(path(name));
    return {std::istreambuf_iterator<char>(in), {}};
  }
  // A production bundle of a unit with cross-axis terms.
  void simulate(const std::string& name, int seed) {
    write("unit.json", R"({"protocol": "production", "seed": )" + std::to_string(seed) +
                           R"(, "effects": [{"name": "non_orthogonality",
                  "parameters": {"yz_xz_xy": [0.008, 0.006, -0.007]}}]})");
    ASSERT_EQ(run({"simulate", "--scenario", path("unit.json"), "-o", path(name)}).exit_code, 0);
  }
  tests::Answer adopt(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"gap", "adopt"});
    return run(arguments);
  }
};

TEST_F(GapAdopt, LearnsFromBundlesAndFromAnswers) {
  std::filesystem::create_directory(path("bench"));
  simulate("bench/a", 1);
  simulate("bench/b", 2);
  simulate("c", 3);
  write("c.json", run({"gap", "diagnose", path("c"), "--json"}).out);
  const auto dry = adopt({path("bench"), "-o", path("S.json"), "--dry-run", "--json"});
  EXPECT_EQ(dry.exit_code, 0) << dry.people;
  EXPECT_EQ(dry.json()["schema"], "sixpoint/gap-adopt/1");
  EXPECT_EQ(dry.json()["written"], false);
  EXPECT_EQ(dry.json()["documents"].size(), 2U);
  EXPECT_FALSE(std::filesystem::exists(path("S.json"))) << "--dry-run writes nothing";

  const auto first = adopt({path("bench"), "-o", path("S.json")});
  EXPECT_EQ(first.exit_code, 0) << first.people;
  EXPECT_THAT(first.out, HasSubstr("non_orthogonality"));
  EXPECT_THAT(first.out, HasSubstr("added"));
  const std::string one = read("S.json");

  EXPECT_EQ(adopt({path("c.json"), "-o", path("S.json")}).exit_code, 73) << "not silently";
  EXPECT_EQ(read("S.json"), one);
  const auto second =
      adopt({path("c.json"), "--scenario", path("S.json"), "-o", path("T.json"), "--json"});
  EXPECT_EQ(second.exit_code, 0) << second.people;
  EXPECT_EQ(second.json()["adoption"], 2);
  EXPECT_EQ(second.json()["documents"].size(), 3U);
  EXPECT_EQ(adopt({path("c.json"), "-o", path("S.json"), "--force"}).exit_code, 0);
  EXPECT_EQ(nlohmann::json::parse(read("S.json"))["population"]["effects"],
            nlohmann::json::parse(read("T.json"))["population"]["effects"])
      << "extended, not begun anew";
  const std::string both = read("S.json");
  const auto again = adopt({path("c"), "-o", path("S.json"), "--force"});
  EXPECT_THAT(again.out, HasSubstr("nothing new"));
  EXPECT_EQ(read("S.json"), both) << "the bundle is that of the answer";

  // `simulate` uses it from then on.
  EXPECT_EQ(run({"simulate", "--scenario", path("S.json"), "-o", path("again")}).exit_code, 0);
  const auto found = run({"gap", "diagnose", path("again"), "--json"}).json();
  EXPECT_EQ(found["effects"][0]["name"], "non_orthogonality");
}

// Two adoptions at once: one of them would be lost. Oracle: the lock of another open file.
TEST_F(GapAdopt, WhileAnotherWritesTheScenarioItIsRefused) {
  simulate("a", 1);
  simulate("b", 2);
  std::filesystem::create_directory(path("out"));
  const std::string scenario = path("out/S.json");
  EXPECT_EQ(adopt({path("a"), "-o", scenario, "--force"}).exit_code, 0);
  const std::string one = read("out/S.json");
  auto other = posix_env().files.lock(scenario);
  ASSERT_TRUE(other && *other != nullptr);
  const auto refused = adopt({path("b"), "-o", scenario, "--force"});
  EXPECT_EQ(refused.exit_code, 73);
  EXPECT_THAT(refused.people, HasSubstr("another command is writing this scenario"));
  EXPECT_EQ(read("out/S.json"), one);
  EXPECT_EQ(adopt({path("b"), "-o", scenario, "--force", "--dry-run"}).exit_code, 0);
  other->reset();
  EXPECT_EQ(adopt({path("b"), "-o", scenario, "--force", "--json"}).json()["adoption"], 2);
  const std::filesystem::directory_iterator files(path("out"));
  EXPECT_EQ(std::distance(begin(files), end(files)), 1) << "no lock file stays";
}

TEST_F(GapAdopt, TheNextDiagnosisExpectsThePopulation) {
  simulate("unit", 4);
  write("P.json", R"({"protocol": "production", "population": {"effects": [
    {"name": "non_orthogonality", "units": 6, "mean": {"yz_xz_xy": [0.008, 0.006, -0.007]},
     "spread": {"yz_xz_xy": [0.001, 0.001, 0.001]}}]}})");
  const auto diagnose = [&](const char* population) {
    return run({"gap", "diagnose", path("unit"), "--population", path(population), "--json"});
  };
  const auto learnt = diagnose("P.json").json()["effects"];
  ASSERT_EQ(learnt.size(), 1U);
  EXPECT_EQ(learnt[0]["name"], "non_orthogonality");
  EXPECT_EQ(learnt[0]["learnt_from_units"], 6);
  const auto alone = run({"gap", "diagnose", path("unit"), "--json"}).json()["effects"];
  EXPECT_EQ(alone[0]["learnt_from_units"], 0) << "the catalogue's sizes";
  const auto plain = diagnose("unit.json");
  EXPECT_EQ(plain.exit_code, 78) << "a scenario without a population";
  EXPECT_NE(plain.people.find(path("unit.json") + ": /population: this scenario has no population"),
            std::string::npos)
      << plain.people;
  EXPECT_EQ(diagnose("none.json").exit_code, 66);
}

// A unit's raw counts, six faces and three repeats: the run is read as `gap trends` reads it.
TEST_F(GapAdopt, TakesTheRunsOfAStore) {
  for (const char* seed : {"7", "8"}) {
    ASSERT_EQ(run({"jig", "--device", std::string("virtual:jig=auto,seed=") + seed, "--jig",
                   "virtual", "--store", path("s.db")})
                  .exit_code,
              0);
  }
  for (const std::vector<std::string>& source :
       {std::vector<std::string>{path("s.db")}, {"--store", path("s.db")}}) {
    std::vector<std::string> arguments = source;
    arguments.insert(arguments.end(), {"-o", path("S.json"), "--dry-run", "--json"});
    const auto answer = adopt(arguments);
    EXPECT_EQ(answer.exit_code, 0) << answer.people;
    EXPECT_EQ(answer.json()["documents"].size(), 2U);
  }
}

TEST_F(GapAdopt, RefusesWhatItCannotRead) {
  EXPECT_EQ(adopt({"-o", path("S.json")}).exit_code, 64) << "nothing to learn from";
  EXPECT_EQ(adopt({path("none"), "-o", path("S.json")}).exit_code, 66);
  EXPECT_EQ(adopt({"--store", path("none.db"), "-o", path("S.json")}).exit_code, 66);
  std::filesystem::create_directory(path("empty"));
  EXPECT_EQ(adopt({path("empty"), "-o", path("S.json")}).exit_code, 66);
  write("wrong.json", "{}");
  const auto wrong = adopt({path("wrong.json"), "-o", path("S.json"), "--json"});
  EXPECT_EQ(wrong.exit_code, 65);
  EXPECT_EQ(wrong.json()["error"]["code"], "bad_data");
  simulate("a", 1);
  EXPECT_EQ(adopt({path("a"), "--scenario", path("wrong.json"), "-o", path("S.json")}).exit_code,
            78);
  EXPECT_FALSE(std::filesystem::exists(path("S.json")));
}

}  // namespace
}  // namespace sixpoint::cli
