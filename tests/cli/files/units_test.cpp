// repair, scan and archive over the files of one unit, on the real disk.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "cli/command_fixture.h"
#include "expect_result.h"
#include "repair/units/unit_files.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::half_sphere;

class UnitsCommand : public tests::CommandTest {
 protected:
  UnitsCommand() { std::filesystem::create_directories(archive_ + "/sub"); }
  void two_halves() {
    EXPECT_OK(half_sphere(2, 1, 1).write(files_, archive_ + "/up.gt3x"));
    EXPECT_OK(half_sphere(2, -1, 2).write(files_, archive_ + "/sub/down.gt3x"));
  }
  std::string archive_ = folder_ / "archive";
  std::string out_ = folder_ / "out";
  FileSystem& files_ = posix_env().files;
};

TEST_F(UnitsCommand, FilesOfAUnitAreRepairedByOneAnotherInOneCommand) {
  two_halves();
  EXPECT_EQ(run({"repair", archive_, "-o", folder_ / "alone", "--no-pool"}).exit_code, 1)
      << "none of them suffices by itself";
  const auto answer = run({"repair", archive_, "-o", out_, "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const Json json = answer.json();
  EXPECT_EQ(json["summary"]["repaired"], 2);
  EXPECT_EQ(json["files"][0]["source"]["kind"], "unit_files");
  ASSERT_EQ(json["units"].size(), 1U);
  EXPECT_EQ(json["units"][0]["repaired"], 2);
  EXPECT_EQ(json["units"][0]["help"], nullptr);
  EXPECT_TRUE(std::filesystem::exists(out_ + "/units.csv"));
  const auto again = run({"repair", archive_, "-o", out_, "--resume", "--json"});
  EXPECT_EQ(again.exit_code, 0) << again.people << "the same constants, so nothing is outdated";
  EXPECT_EQ(again.json()["summary"]["repaired"], 2);
}

TEST_F(UnitsCommand, ShardsOfAPlanUseTheSameConstantsAsOneRepair) {
  two_halves();
  const Json expected = run({"repair", archive_, "-o", folder_ / "whole", "--json"}).json();
  const std::string plan = folder_ / "plan";
  const auto planned = run({"archive", "plan", archive_, "-o", plan, "--shards", "2", "--json"});
  EXPECT_EQ(planned.exit_code, 0) << planned.people;
  EXPECT_EQ(planned.json()["units"].size(), 1U);
  for (const char* shard : {"0", "1"}) {
    EXPECT_EQ(run({"archive", "run", plan, "--shard", shard, "-o", out_}).exit_code, 0);
  }
  const auto merged = run({"archive", "merge", plan, "--json"});
  EXPECT_EQ(merged.exit_code, 0) << merged.people;
  EXPECT_EQ(merged.json()["summary"], expected["summary"]);
  EXPECT_EQ(merged.json()["units"], expected["units"]);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(merged.json()["files"][i]["source"]["id"], expected["files"][i]["source"]["id"]);
    EXPECT_EQ(merged.json()["files"][i]["still_error_mg"], expected["files"][i]["still_error_mg"]);
  }
  // A plan whose units were edited is refused.
  std::ofstream(plan + "/units.jsonl", std::ios::app) << "\n";
  EXPECT_EQ(run({"archive", "run", plan, "--shard", "0", "-o", out_}).exit_code, 78);
}

TEST_F(UnitsCommand, FilesAfterALaterCalibrationHelpInARepairAndInAPlan) {
  auto again = half_sphere(2, -1, 2);
  again.calibrated = 1'402'000'000;
  EXPECT_OK(half_sphere(2, 1, 1).write(files_, archive_ + "/up.gt3x"));
  EXPECT_EQ(run({"repair", archive_, "-o", folder_ / "without"}).exit_code, 1);
  EXPECT_OK(again.write(files_, archive_ + "/again.gt3x"));
  const auto answer = run({"repair", archive_, "-o", folder_ / "with", "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_EQ(answer.json()["summary"]["repaired"], 1);
  EXPECT_EQ(answer.json()["summary"]["not_affected"], 1);
  const std::string plan = folder_ / "plan";
  EXPECT_EQ(run({"archive", "plan", archive_, "-o", plan, "--shards", "2"}).exit_code, 0);
  for (const char* shard : {"0", "1"}) {
    EXPECT_EQ(run({"archive", "run", plan, "--shard", shard, "-o", out_}).exit_code, 0);
  }
  EXPECT_EQ(run({"archive", "merge", plan, "--json"}).json()["summary"], answer.json()["summary"]);
}

TEST_F(UnitsCommand, WhatIsMissingStandsInTheTable) {
  EXPECT_OK(half_sphere(2, 1, 1).write(files_, archive_ + "/a.gt3x"));
  EXPECT_OK(half_sphere(2, 1, 2).write(files_, archive_ + "/b.gt3x"));
  const auto words = run({"repair", archive_, "-o", out_});
  EXPECT_EQ(words.exit_code, 1);
  EXPECT_THAT(words.people, HasSubstr("2 files wait for constants; -z was never up"));
  EXPECT_THAT(run({"archive", "plan", archive_, "-o", folder_ / "plan"}).people,
              HasSubstr("2 files wait for constants; -z was never up"));
  const auto scanned = run({"scan", archive_, "--json", "--units", folder_ / "units.csv"});
  EXPECT_EQ(scanned.json()["units"][0]["sides_missing"], Json({"-z"}));
  std::string line;
  std::ifstream csv(folder_ / "units.csv");
  std::getline(csv, line);
  std::getline(csv, line);
  EXPECT_THAT(line, HasSubstr("MOS2A45130450,2,2,0,0,0,2,0,0,+x -x +y -y +z,-z,"));
  EXPECT_EQ(run({"scan", archive_, "--units", folder_ / "units.csv"}).exit_code, 73)
      << "a file that is there is not replaced";
}

TEST_F(UnitsCommand, ReportsAreOnePage) {
  two_halves();
  const std::string page = out_ + "/report.html";
  ASSERT_EQ(run({"repair", archive_, "-o", out_, "--report"}).exit_code, 0);
  const Bytes bytes = read_file(files_, page).value();
  const std::string text(bytes.begin(), bytes.end());
  EXPECT_THAT(text, HasSubstr("<figure>"));
  EXPECT_THAT(text, HasSubstr("unit_files"));
  EXPECT_THAT(text, testing::ContainsRegex("<p>[0-9-]+ [0-9:]+ [+-][0-9:]+, sixpoint"))
      << "the clock on the wall";
  const std::string plan = folder_ / "plan";
  ASSERT_EQ(run({"archive", "plan", archive_, "-o", plan, "--shards", "2"}).exit_code, 0);
  ASSERT_EQ(run({"archive", "run", plan, "--shard", "0", "-o", folder_ / "out2"}).exit_code, 0);
  const auto report = run({"archive", "report", plan, "-o", folder_ / "plan.html", "--json"});
  EXPECT_EQ(report.exit_code, 2) << "a shard is missing";
  EXPECT_EQ(report.json()["files_missing"], 1);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "plan.html"));
  EXPECT_EQ(run({"archive", "report", plan, "-o", folder_ / "plan.html"}).exit_code, 73);
}

TEST_F(UnitsCommand, TheOutputTreeIsAWholeStudyWithLinks) {
  two_halves();
  auto sound = half_sphere(2, 1, 3);
  sound.firmware = "1.8.0";
  std::filesystem::create_directories(archive_ + "/deep/er");
  EXPECT_OK(sound.write(files_, archive_ + "/deep/er/sound.gt3x"));
  for (const char* kind : {"hard", "symbolic"}) {
    const std::string out = folder_ / kind;
    const auto answer = run({"repair", archive_, "-o", out, "--link-unaffected", kind, "--json"});
    EXPECT_EQ(answer.exit_code, 0) << answer.people;
    EXPECT_TRUE(
        std::filesystem::equivalent(archive_ + "/deep/er/sound.gt3x", out + "/deep/er/sound.gt3x"));
    EXPECT_TRUE(std::filesystem::exists(out + "/sub/down.gt3x"));
    // Through a plan the same.
    const std::string plan = folder_ / (std::string("plan-") + kind);
    ASSERT_EQ(
        run({"archive", "plan", archive_, "-o", plan, "--shards", "1", "--link-unaffected", kind})
            .exit_code,
        0);
    const std::string by_plan = folder_ / (std::string("by-plan-") + kind);
    ASSERT_EQ(run({"archive", "run", plan, "--shard", "0", "-o", by_plan}).exit_code, 0);
    EXPECT_TRUE(std::filesystem::equivalent(archive_ + "/deep/er/sound.gt3x",
                                            by_plan + "/deep/er/sound.gt3x"));
  }
  EXPECT_EQ(run({"repair", archive_, "-o", out_, "--link-unaffected", "copy"}).exit_code, 64);
}

TEST_F(UnitsCommand, NoEmptyFoldersAreLeft) {
  two_halves();
  auto sound = half_sphere(2, 1, 3);
  sound.firmware = "1.8.0";
  std::filesystem::create_directories(archive_ + "/deep/er");
  EXPECT_OK(sound.write(files_, archive_ + "/deep/er/sound.gt3x"));
  ASSERT_EQ(run({"repair", archive_, "-o", out_}).exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(out_ + "/deep"));
  const std::string plan = folder_ / "plan";
  ASSERT_EQ(run({"archive", "plan", archive_, "-o", plan, "--shards", "1"}).exit_code, 0);
  ASSERT_EQ(run({"archive", "run", plan, "--shard", "0", "-o", folder_ / "by-plan"}).exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "by-plan/deep"));
}

TEST_F(UnitsCommand, TwoRunsIntoOneFolderAreRefused) {
  two_halves();
  std::filesystem::create_directories(out_);
  const auto held = files_.lock(out_ + "/.sixpoint-repair.lock");
  ASSERT_OK(held);
  const auto answer = run({"repair", archive_, "-o", out_});
  EXPECT_EQ(answer.exit_code, 73);
  EXPECT_THAT(answer.people, HasSubstr("another run is repairing into this folder"));
  EXPECT_FALSE(std::filesystem::exists(out_ + "/up.gt3x"));
  EXPECT_EQ(run({"repair", archive_, "-o", out_, "--dry-run"}).exit_code, 0)
      << "a dry run writes nothing and needs no lock";
}

TEST_F(UnitsCommand, AHundredLevelsOfFolders) {
  std::string deep = archive_;
  for (int level = 0; level < 100; ++level) {
    deep += "/d";
  }
  std::filesystem::create_directories(deep);
  EXPECT_OK(tests::many_sides().write(files_, deep + "/a.gt3x"));
  const auto answer = run({"repair", archive_, "-o", out_, "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_TRUE(std::filesystem::exists(answer.json()["files"][0]["output"].get<std::string>()));
}

}  // namespace
}  // namespace sixpoint::cli
