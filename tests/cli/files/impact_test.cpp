// sixpoint impact by its contract; tests/repair/impact has the numbers.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/jig_constants.h"
#include "repair/six_sides.h"
#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::run_command;

class ImpactCommand : public testing::Test {
 protected:
  void SetUp() override { EXPECT_OK(tests::six_sides().write(memory_.files, "in.gt3x")); }
  auto run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "impact");
    return run_command(memory_.env, arguments);
  }
  // With what the sensor of the made recordings really is.
  void repair(const std::string& input, const std::string& output) {
    ASSERT_OK(write_file(memory_.files, "/c.json", R"({"serial": "MOS2A45130450",
      "filter": "current", "constants": {"zero_lsb": [95.2, 52.3, 90.8],
      "sensitivity_g_per_lsb": [0.00420698, 0.00397141, 0.00412712]}})"));
    ASSERT_EQ(run_command(memory_.env, {"repair", input, "-o", output, "--constants", "/c.json"})
                  .exit_code,
              0);
  }
  MemoryEnv memory_;
};

TEST_F(ImpactCommand, AtRestARepairTakesTheFalseActivityAway) {
  repair("in.gt3x", "out");
  const auto answer = run({"in.gt3x", "out/in.gt3x", "--cut", "more=20", "--json"});
  ASSERT_EQ(answer.exit_code, 0) << answer.people;
  const Json json = answer.json();
  EXPECT_EQ(json["schema"], "sixpoint/impact/1");
  EXPECT_EQ(json["epochs"], 14);
  EXPECT_TRUE(json["enmo_uncertainty_mg"]["before"].is_null());
  const Json& more = json["minutes_above"]["more"];
  EXPECT_NEAR(more["after"].get<double>(), 10.0 / 60, 1e-9) << "it was moved for ten seconds";
  EXPECT_GT(more["before"].get<double>(), 20.0 / 60);
}

// A folder of two recordings, of which one was repaired; then the same as a plan.
TEST_F(ImpactCommand, OfAStudy) {
  ASSERT_OK(memory_.files.make_folders("/data/study/sub"));
  EXPECT_OK(tests::six_sides().write(memory_.files, "/data/study/sub/a.gt3x"));
  EXPECT_OK(tests::six_sides().write(memory_.files, "/data/study/b.gt3x"));
  repair("/data/study", "/data/out");
  ASSERT_OK(memory_.files.remove("/data/out/b.gt3x"));
  const auto answer = run({"/data/study", "/data/out", "--cut", "more=20", "--csv", "study.csv",
                           "--jobs", "2", "--json"});
  ASSERT_EQ(answer.exit_code, 0) << answer.people;
  const Json json = answer.json();
  ASSERT_EQ(json["recordings"].size(), 1U);
  EXPECT_EQ(json["recordings"][0]["after"], "/data/out/sub/a.gt3x");
  EXPECT_EQ(json["summary"]["without_copy"], 1);
  const auto alone =
      run({"/data/study/sub/a.gt3x", "/data/out/sub/a.gt3x", "--cut", "more=20", "--json"});
  const Json one = alone.json();
  EXPECT_EQ(json["summary"]["enmo_mg"], one["enmo_mg"]);
  EXPECT_EQ(json["summary"]["minutes_above"]["more"]["after"],
            one["minutes_above"]["more"]["after"]);
  EXPECT_TRUE(memory_.files.info("study.csv"));
  EXPECT_EQ(run({"/data/study", "/data/out/sub/a.gt3x"}).exit_code, 64)
      << "one of the two is a folder";
  EXPECT_EQ(run({"/data/study", "/data/out", "--html", "p.html"}).exit_code, 64);
  EXPECT_EQ(run({"/data/study"}).exit_code, 66) << "no plan";
  ASSERT_OK(memory_.files.make_folders("/data/empty"));
  EXPECT_EQ(run({"/data/study", "/data/empty"}).exit_code, 2) << "nothing to compare";

  ASSERT_EQ(run_command(memory_.env, {"archive", "plan", "/data/study", "-o", "/data/plan",
                                      "--shards", "1", "--constants", "/c.json"})
                .exit_code,
            0);
  EXPECT_EQ(run({"/data/plan"}).exit_code, 2) << "it has not run";
  ASSERT_EQ(run_command(memory_.env,
                        {"archive", "run", "/data/plan", "--shard", "0", "-o", "/data/again"})
                .exit_code,
            0);
  const auto of_plan = run({"/data/plan", "--json"});
  ASSERT_EQ(of_plan.exit_code, 0) << of_plan.people;
  EXPECT_EQ(of_plan.json()["summary"]["files"], 2);
  EXPECT_EQ(of_plan.json()["summary"]["enmo_mg"]["after"], one["enmo_mg"]["after"]);
}

TEST_F(ImpactCommand, TheTwoMustBelongTogether) {
  repair("in.gt3x", "out");
  tests::MadeRecording other = tests::six_sides();
  other.raw.pop_back();
  ASSERT_OK(other.write(memory_.files, "other.gt3x"));
  EXPECT_EQ(run({"in.gt3x", "out/in.gt3x"}).exit_code, 0);
  EXPECT_EQ(run({"in.gt3x", "other.gt3x"}).exit_code, 0) << "without a mark";
  const auto mixed = run({"other.gt3x", "out/in.gt3x"});
  EXPECT_EQ(mixed.exit_code, 65);
  EXPECT_THAT(mixed.people, HasSubstr("made of another recording"));
  const auto turned = run({"out/in.gt3x", "in.gt3x"});
  EXPECT_EQ(turned.exit_code, 65);
  EXPECT_THAT(turned.people, HasSubstr("as it was first"));
}

TEST_F(ImpactCommand, OfAStudyWithoutAReadableCopyThereIsNoMean) {
  ASSERT_OK(memory_.files.make_folders("/a"));
  ASSERT_OK(memory_.files.make_folders("/b"));
  EXPECT_OK(tests::six_sides().write(memory_.files, "/a/x.gt3x"));
  ASSERT_OK(write_file(memory_.files, "/b/x.gt3x", "cut"));
  const auto answer = run({"/a", "/b", "--json"});
  EXPECT_EQ(answer.exit_code, 65) << answer.people;
  EXPECT_TRUE(answer.json()["summary"]["enmo_mg"]["before"].is_null()) << answer.out;
  EXPECT_THAT(run({"/a", "/b"}).out, HasSubstr("no recording could be compared"));
}

// A link to a disk that is not mounted: it has a line, and is not left out in silence.
TEST_F(ImpactCommand, WhatCannotBeReadInAStudyIsSaid) {
  const tests::TemporaryFolder folder;
  Env& env = posix_env();
  ASSERT_OK(env.files.make_folders(folder / "study"));
  ASSERT_OK(tests::six_sides().write(env.files, folder / "study/a.gt3x"));
  std::filesystem::create_symlink(folder / "away.gt3x", folder / "study/b.gt3x");
  std::ofstream(folder / "c.json") << tests::kConstants;
  const auto planned = run_command(env, {"archive", "plan", folder / "study", "-o", folder / "plan",
                                         "--shards", "1", "--constants", folder / "c.json"});
  EXPECT_EQ(planned.exit_code, 66) << planned.people;
  ASSERT_EQ(run_command(env, {"archive", "run", folder / "plan", "--shard", "0", "-o",
                              folder / "out", "--json"})
                .exit_code,
            0);
  for (const std::vector<std::string>& line :
       {std::vector<std::string>{"impact", folder / "study", folder / "out"},
        {"impact", folder / "plan"}}) {
    EXPECT_THAT(run_command(env, line).out, HasSubstr("b.gt3x"));
    std::vector<std::string> as_json = line;
    as_json.emplace_back("--json");
    const auto answer = run_command(env, as_json);
    EXPECT_EQ(answer.exit_code, 66) << answer.out;
    const Json json = answer.json();
    ASSERT_EQ(json["recordings"].size(), 2U);
    EXPECT_EQ(json["recordings"][1]["before"], folder / "study/b.gt3x");
    EXPECT_TRUE(json["recordings"][1].contains("error"));
    EXPECT_EQ(json["summary"]["files"], 1);
    EXPECT_EQ(json["summary"]["failed"], 1);
  }
}

TEST_F(ImpactCommand, OneRecordingWritesItsFiles) {
  const auto answer = run({"in.gt3x", "--csv", "e.csv", "--html", "p.html"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_THAT(answer.out, HasSubstr("counts/min, X Y Z"));
  EXPECT_TRUE(memory_.files.info("e.csv"));
  EXPECT_TRUE(memory_.files.info("p.html"));
  EXPECT_EQ(run({"in.gt3x", "--csv", "e.csv"}).exit_code, 73) << "it is there";
}

TEST_F(ImpactCommand, WhatIsWrongIsSaid) {
  EXPECT_EQ(run({"in.gt3x", "--cut", "much=enmo:100"}).exit_code, 64);
  const auto twice = run({"in.gt3x", "--cut", "a=5", "--cut", "b=5", "--cut", "a=10"});
  EXPECT_EQ(twice.exit_code, 64) << "one of them would be lost";
  EXPECT_THAT(twice.people, HasSubstr("a: two cut points"));
  EXPECT_EQ(run({"in.gt3x", "--cut", "a=5", "--cut", "b=10"}).exit_code, 0);
  EXPECT_EQ(run({"in.gt3x", "--epoch", "0"}).exit_code, 64);
  EXPECT_EQ(run({"in.gt3x", "--epoch", "3000"}).exit_code, 65);
  EXPECT_EQ(run({"none.gt3x"}).exit_code, 66);
  ASSERT_OK(memory_.files.make_folders("folder"));
  for (const auto& two :
       std::vector<std::vector<std::string>>{{"none", "folder"}, {"folder", "none"}}) {
    const auto missing = run(two);
    EXPECT_EQ(missing.exit_code, 66) << two[0];
    EXPECT_THAT(missing.people, HasSubstr("none: "));
  }
  EXPECT_EQ(run({"in.gt3x", "folder"}).exit_code, 64) << "both are there";
}

}  // namespace
}  // namespace sixpoint::cli
