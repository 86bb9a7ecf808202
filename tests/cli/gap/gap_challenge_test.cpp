// gap challenge: trials, and scores of a diagnosis of which everything is known.
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "run_command.h"
#include "shared_data.h"
#include "temporary_folder.h"

namespace sixpoint {
namespace {

class GapChallenge : public ::testing::Test {
 protected:
  // A program that gives the same answer to everything.
  std::string program(const std::string& answer) {
    const std::string path = (folder_ / "diagnose.sh");
    std::ofstream(path) << "#!/bin/sh\necho \"$@\" >>" << (folder_ / "calls") << "\n" << answer;
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return path;
  }
  tests::Answer challenge(const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"gap",    "challenge", "--protocol", "production",
                                          "--seed", "3",         "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return tests::run_command(posix_env(), arguments);
  }
  tests::TemporaryFolder folder_;
};

TEST_F(GapChallenge, ScoresAnAnswerThatIsAlwaysTilt) {
  const std::string path = program(
      R"(echo '{"verdict": "explained", "effects": [{"name": "tilt", "probability": 0.95}],
        "candidates": [{"name": "tilt", "probability": 0.95}], "unknown": {"present": false},
        "not_observable": []}')");
  const auto all_tilt = challenge({"--program", path, "--trials", "5", "--effects", "tilt",
                                   "--none", "0", "--outside", "0", "--pairs", "0"});
  EXPECT_EQ(all_tilt.exit_code, 0) << all_tilt.people;
  EXPECT_EQ(all_tilt.json()["scores"]["single_first_right"]["right"], 5);
  EXPECT_NEAR(all_tilt.json()["scores"]["expected_calibration_error"].get<double>(), 0.05, 1e-9);
  const auto none = challenge({"--program", path, "--trials", "5", "--none", "1"});
  EXPECT_EQ(none.json()["scores"]["none_alarms"]["right"], 5);
  const auto outside =
      challenge({"--program", path, "--trials", "5", "--none", "0", "--outside", "1"});
  EXPECT_EQ(outside.json()["scores"]["withheld_confidently_wrong"]["right"], 5);
  EXPECT_EQ(outside.json()["scores"]["withheld_honest"]["right"], 0);
}

// A diagnosis that never ends; `ready` is there once it runs.
TEST_F(GapChallenge, StoppedItLeavesNoProcessAndNoFolder) {
  const std::string path = program("echo $$ >" + (folder_ / "pid") + "\nmv " + (folder_ / "pid") +
                                   " " + (folder_ / "ready") + "\nexec sleep 1000\n");
  for (const int signal : {SIGINT, SIGTERM}) {
    const std::string temporary = folder_ / "temporary";
    std::filesystem::create_directory(temporary);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      ::setenv("TMPDIR", temporary.c_str(), 1);
      if (std::freopen((folder_ / "stdout").c_str(), "w", stdout) == nullptr) {
        ::_exit(126);
      }
      ::execl(SIXPOINT_PROGRAM, "sixpoint", "gap", "challenge", "--protocol", "production",
              "--trials", "4", "--json", "--program", path.c_str(), nullptr);
      ::_exit(127);
    }
    while (!std::filesystem::exists(folder_ / "ready")) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_FALSE(std::filesystem::is_empty(temporary));
    ASSERT_EQ(::kill(child, signal), 0);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 3);
    std::ifstream out(folder_ / "stdout");
    const auto json = nlohmann::ordered_json::parse(out, nullptr, /*allow_exceptions=*/false);
    ASSERT_TRUE(json.is_object());
    EXPECT_EQ(json["stopped"], true);
    EXPECT_TRUE(std::filesystem::is_empty(temporary));
    pid_t diagnosis = 0;
    std::ifstream(folder_ / "ready") >> diagnosis;
    ASSERT_GT(diagnosis, 0);
    EXPECT_EQ(::kill(diagnosis, 0), -1) << "it works on";
    std::filesystem::remove(folder_ / "ready");
    std::filesystem::remove(temporary);
  }
}

TEST_F(GapChallenge, StripTakesTheTruthAwayAndTheBundleKeepsIt) {
  const std::string path =
      program(R"(echo '{"verdict": "unexplained", "effects": [], "unknown": {"present": true}}')");
  const auto stripped = challenge(
      {"--program", path, "--trials", "3", "--effects", "drift", "--none", "0", "--outside", "0",
       "--pairs", "0", "--strip", "--keep", (folder_ / "kept"), "--html", (folder_ / "page.html")});
  EXPECT_EQ(stripped.exit_code, 0) << stripped.people;
  EXPECT_EQ(stripped.json()["scores"]["withheld_honest"]["right"], 3);
  std::ifstream calls((folder_ / "calls"));
  std::string line;
  while (std::getline(calls, line)) {
    EXPECT_NE(line.find("--without drift"), std::string::npos) << line;
  }
  // What the diagnosis sees holds no trace of the truth.
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator((folder_ / "kept") + "/000000")) {
    std::ifstream file(entry.path(), std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    EXPECT_EQ(text.find("drift"), std::string::npos) << entry.path();
  }
  EXPECT_TRUE(std::filesystem::exists((folder_ / "page.html")));
}

// The real diagnosis on trials that it never saw. The bounds are far below what it reaches
// (docs/gap.md): chance must not break the test.
TEST_F(GapChallenge, TheRealDiagnosisStandsASmallRun) {
  const auto production =
      challenge({"--program", SIXPOINT_BINARY_DIR "/sixpoint", "--trials", "30"}).json();
  const auto& scores = production["scores"];
  EXPECT_EQ(scores["failures"]["right"], 0);
  EXPECT_LE(scores["none_alarms"]["right"].get<int>(), 1);
  EXPECT_GE(scores["single_first_right_observable"]["share"].get<double>(), 0.8);
  EXPECT_LE(scores["expected_calibration_error"].get<double>(), 0.05);
}

TEST_F(GapChallenge, TheRealDiagnosisStandsASmallRunOfTheWholeProtocol) {
  const auto engineering =
      tests::run_command(posix_env(),
                         {"gap", "challenge", "--program", SIXPOINT_BINARY_DIR "/sixpoint",
                          "--trials", "12", "--protocol", "engineering", "--seed", "5", "--json"})
          .json();
  EXPECT_EQ(engineering["scores"]["failures"]["right"], 0);
  EXPECT_LE(engineering["scores"]["withheld_confidently_wrong"]["right"].get<int>(), 1);
  EXPECT_GE(engineering["scores"]["single_first_right_observable"]["share"].get<double>(), 0.8);
}

// The program answers with `tilt` once the bundle has yaws: the gain is all trials.
TEST_F(GapChallenge, FollowsWhatTheAnswerSuggests) {
  const std::string path = program(R"(if grep -q '"yaw"' "$3/protocol.json"; then
  echo '{"verdict": "explained", "effects": [{"name": "tilt", "probability": 0.95}],
         "candidates": [{"name": "tilt", "probability": 0.95}], "unknown": {"present": false}}'
else
  echo '{"verdict": "no_gap", "effects": [], "candidates": [{"name": "tilt", "probability": 0.25}],
         "unknown": {"present": false}, "next_segments": [
           {"name": "yaw", "minutes": 6.4, "expected_nats": 0.4, "separates": ["tilt"]},
           {"name": "shaker", "minutes": 9, "expected_nats": 0.1, "separates": []}]}'
fi)");
  const std::vector<std::string> tilts = {"--program", path, "--trials",  "4", "--effects", "tilt",
                                          "--none",    "0",  "--outside", "0", "--pairs",   "0"};
  std::vector<std::string> followed = tilts;
  followed.emplace_back("--follow-suggestion");
  const auto json = challenge(followed).json();
  EXPECT_EQ(json["followed"]["trials"], 4);
  EXPECT_EQ(json["followed"]["minutes"], 6.4);
  EXPECT_EQ(json["followed"]["named"]["before"]["right"], 0);
  EXPECT_EQ(json["followed"]["named"]["after"]["right"], 4);
  EXPECT_NEAR(json["followed"]["probability_gain"]["mean"].get<double>(), 0.7, 1e-9);
  EXPECT_EQ(json["followed"]["by_segment"][0]["segment"], "yaw");
  EXPECT_EQ(json["scores"]["single_first_right"]["right"], 0) << "the trials as they were";
  EXPECT_FALSE(challenge(tilts).json().contains("followed"));
  followed.emplace_back("--strip");
  EXPECT_EQ(challenge(followed).exit_code, 64);
}

// With the real diagnosis: more is named, and nothing that is not there.
TEST_F(GapChallenge, WhatTheDiagnosisSuggestsHelps) {
  const auto answer =
      challenge({"--program", SIXPOINT_BINARY_DIR "/sixpoint", "--trials", "6", "--realistic", "1",
                 "--none", "0", "--outside", "0", "--pairs", "0", "--follow-suggestion"});
  ASSERT_EQ(answer.exit_code, 0) << answer.people;
  const auto followed = answer.json()["followed"];
  EXPECT_EQ(followed["trials"], 6) << "three minutes leave much open";
  EXPECT_GT(followed["expected_nats"].get<double>(), 0);
  EXPECT_GE(followed["named"]["after"]["right"].get<int>(),
            followed["named"]["before"]["right"].get<int>());
}

// Semi-synthetic: the effect is added to what was recorded, whose own effects count for nothing.
TEST_F(GapChallenge, AddsEffectsToARecording) {
  std::ofstream(folder_ / "unit.json")
      << R"({"schema": "sixpoint/scenario/1", "seed": 31, "protocol": "production",
             "effects": [{"name": "tilt", "parameters": {"rotation_vector_deg": [0.3, 0, 0]}}]})";
  ASSERT_EQ(tests::run_command(posix_env(), {"simulate", "--scenario", folder_ / "unit.json", "-o",
                                             folder_ / "recorded"})
                .exit_code,
            0);
  const auto answer = tests::run_command(
      posix_env(), {"gap", "challenge", "--program", SIXPOINT_BINARY_DIR "/sixpoint", "--recording",
                    folder_ / "recorded", "--effects", "misalignment,seating,idle_sleep",
                    "--trials", "12", "--none", "0.2", "--seed", "3", "--json"});
  ASSERT_EQ(answer.exit_code, 0) << answer.people;
  const auto json = answer.json();
  EXPECT_EQ(json["own_effects"], nlohmann::ordered_json::array({"tilt"}));
  EXPECT_EQ(json["scores"]["failures"]["right"], 0);
  EXPECT_EQ(json["scores"]["none_alarms"]["right"], 0);
  EXPECT_GE(json["scores"]["single_first_right"]["share"].get<double>(), 0.8);
  const auto refused = [&](const char* effect, const std::string& recording) {
    return tests::run_command(posix_env(),
                              {"gap", "challenge", "--program", SIXPOINT_BINARY_DIR "/sixpoint",
                               "--recording", recording, "--effects", effect, "--trials", "1"})
        .exit_code;
  };
  EXPECT_EQ(refused("clock_error", folder_ / "recorded"), 64);
  EXPECT_GE(refused("tilt", folder_ / "nowhere"), 64);
}

// A filter mismatch added to a real unit's free living (a GT9X that reads right) is found, and the
// recording as it is raises no alarm; one that has a mismatch of its own is no ground to stand on.
TEST_F(GapChallenge, AddsAFilterMismatchToARealRecording) {
  SIXPOINT_NEED_SHARED("data/gt9x/TAS1E31150129.gt3x");
  SIXPOINT_NEED_SHARED("data/wgt3x-bt-affected/MOS2A45130450.gt3x");
  const auto challenged = [&](const std::string& recording, const char* keep) {
    return tests::run_command(
        posix_env(),
        {"gap", "challenge", "--program", SIXPOINT_BINARY_DIR "/sixpoint", "--recording", recording,
         "--trials", "6", "--none", "0.4", "--seed", "3", "--keep", folder_ / keep, "--json"});
  };
  const std::string real = tests::shared_file("data/gt9x/TAS1E31150129.gt3x");
  const auto answer = challenged(real, "kept");
  ASSERT_EQ(answer.exit_code, 0) << answer.people;
  const auto json = answer.json();
  EXPECT_TRUE(json["own_effects"].empty());
  EXPECT_EQ(json["scores"]["failures"]["right"], 0);
  EXPECT_GE(json["scores"]["none_alarms"]["of"].get<int>(), 1);
  EXPECT_EQ(json["scores"]["none_alarms"]["right"], 0);
  // Twenty-two blocks in few directions: what lies within the gains and offsets that units have
  // anyway is not told from these, and nothing else is named for it.
  EXPECT_GE(json["scores"]["single_first_right"]["of"].get<int>(), 4);
  EXPECT_GE(json["scores"]["single_first_right"]["share"].get<double>(), 0.5);
  // What is no sample record came through as it was, and nothing was changed where nothing was
  // added.
  for (const auto& outcome : json["outcomes"]) {
    const std::string written =
        folder_ / fmt::format("kept/{:06}.gt3x", outcome["trial"].get<int>());
    const auto same = tests::run_command(posix_env(), {"inspect", written, "--json"}).json();
    const auto was = tests::run_command(posix_env(), {"inspect", real, "--json"}).json();
    EXPECT_EQ(same["records"], was["records"]);
    EXPECT_EQ(same["constants"], was["constants"]);
    EXPECT_EQ(same["still"]["magnitude_mg"] == was["still"]["magnitude_mg"],
              outcome["kind"] == "none");
    for (const auto& named : outcome["named"]) {
      EXPECT_EQ(named["name"], "filter_mismatch");
    }
    // 0.15 g and more is never passed over in silence.
    if (same["still"]["magnitude_mg"]["worst_error"].get<double>() > 150) {
      EXPECT_NE(outcome["verdict"], "no_gap") << outcome.dump();
    }
  }
  EXPECT_EQ(challenged(tests::shared_file("data/wgt3x-bt-affected/MOS2A45130450.gt3x"), "other")
                .exit_code,
            65);
}

TEST_F(GapChallenge, AProgramThatFailsIsCounted) {
  const auto crashed = challenge({"--program", program("exit 70"), "--trials", "2"});
  EXPECT_EQ(crashed.exit_code, 1);
  EXPECT_EQ(crashed.json()["scores"]["failures"]["right"], 2);
  EXPECT_EQ(challenge({"--program", program("echo nonsense"), "--trials", "2"}).exit_code, 1);
  EXPECT_EQ(challenge({"--protocol", "sideways"}).exit_code, 64);
  EXPECT_EQ(challenge({"--effects", "gremlins"}).exit_code, 78);
}

}  // namespace
}  // namespace sixpoint
