// sixpoint capture by its contract, on the real disk.
#include "cli/command_fixture.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::CommandTest;
using tests::kDevice;

TEST_F(CommandTest, CaptureMakesACalibrationFile) {
  const auto answer =
      run({"capture", "--device", kDevice, "--jig", "virtual", "--store", path("s.db"), "-o",
           path("c.gt3x"), "--constants-out", path("c.json"), "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const nlohmann::json json = nlohmann::json::parse(answer.out);
  EXPECT_EQ(json["schema"], "sixpoint/capture/1");
  EXPECT_EQ(json["verified"], true);
  EXPECT_EQ(json["file"], path("c.gt3x"));
  EXPECT_TRUE(json["stored_id"].is_string());
  // The file stands on its own: `solve` gives the same constants.
  const auto solve = run({"solve", path("c.gt3x"), "--json"});
  EXPECT_EQ(solve.exit_code, 0);
  EXPECT_EQ(nlohmann::json::parse(solve.out)["constants"], json["constants"]);

  const auto capture_into = [&](const std::string& output) {
    return run({"capture", "--device", kDevice, "--jig", "virtual", "--store", path("s.db"), "-o",
                output});
  };
  EXPECT_EQ(capture_into(path("c.gt3x")).exit_code, 73);
  EXPECT_THAT(next_of(capture_into(path("d.gt3x"))),
              testing::ElementsAre("repair", "RECORDINGS", "--calibration-file", path("d.gt3x"),
                                   "-o", "repaired"));

  // A full disk: the constants are in the store all the same.
  const auto full =
      run({"capture", "--device", kDevice, "--jig", "virtual", "--store", path("s.db"), "-o",
           path("e.gt3x"), "--constants-out", "/dev/full", "--json"});
  EXPECT_EQ(full.exit_code, 74);
  EXPECT_TRUE(full.json()["stored_id"].is_string());
  EXPECT_EQ(full.json()["error"]["code"], "io");
}

TEST_F(CommandTest, CaptureOfCornersStatesItsEfficiency) {
  const auto capture = [&](const char* sides, const char* name) {
    return run({"capture", "--device", kDevice, "--jig", "virtual", "--store", path("s.db"), "-o",
                path(name), "--sides", sides, "--json"});
  };
  const auto corners = capture("corners", "c.gt3x");
  EXPECT_EQ(corners.exit_code, 0) << corners.people;
  EXPECT_THAT(corners.people, HasSubstr("side 6 of 14: -y - its y axis points down"));
  EXPECT_THAT(corners.people, HasSubstr("corner 14 of 14: +x+y-z"));
  EXPECT_EQ(corners.json()["verdict"], "verified");
  EXPECT_GT(corners.json()["efficiency"]["nine"]["d"], 0.97);
  EXPECT_GT(corners.json()["efficiency"]["nine"]["g"], 0.9);
  const auto faces = capture("faces", "f.gt3x");
  EXPECT_EQ(faces.json()["efficiency"]["parameters"], 6);
  EXPECT_GT(faces.json()["efficiency"]["six"]["d"], 0.98);
  EXPECT_EQ(faces.json()["efficiency"]["nine"]["d"], 0);
  EXPECT_THAT(run({"solve", path("f.gt3x")}).out, HasSubstr("too few for cross-axis terms"));
  EXPECT_THAT(run({"solve", path("c.gt3x")}).out, HasSubstr("14 directions; efficiency"));
  EXPECT_EQ(capture("edges", "e.gt3x").exit_code, 64);
}

// What the address of a device names is read: --force replaces none of it.
TEST_F(CommandTest, CaptureWritesOverNothingThatItsDeviceReads) {
  std::filesystem::create_directory(path("drive"));
  const std::string log = path("drive/log.bin");
  std::ofstream(log) << "a recording";
  std::ofstream(path("f.json")) << R"({"schema": "sixpoint/faults/1", "faults": []})";
  const auto capture = [&](const std::string& device, const std::string& constants) {
    return run({"capture", "--device", device, "-o", path("c.gt3x"), "--constants-out", constants,
                "--force"})
        .exit_code;
  };
  EXPECT_EQ(capture("drive:" + path("drive"), log), 73);
  EXPECT_EQ(std::filesystem::file_size(log), 11U);
  EXPECT_EQ(capture("virtual:jig=auto,seed=7,faults=" + path("f.json"), path("f.json")), 73);
  EXPECT_FALSE(std::filesystem::exists(path("c.gt3x")));
  EXPECT_EQ(run({"jig", "--device", "virtual:jig=auto,seed=7,faults=" + path("f.json"), "--label",
                 path("f.json"), "--force"})
                .exit_code,
            73);
}

// `repair` and `solve` of such a file see an hour's pause and refuse it.
TEST_F(CommandTest, CaptureWithAClockThatJumpedRecommendsNoFile) {
  std::ofstream(path("f.json")) << R"({"schema": "sixpoint/faults/1", "faults": [
      {"fault": "clock_jump", "at_s": 100, "seconds": 3600}]})";
  const auto answer =
      run({"capture", "--device", "virtual:jig=auto,seed=7,faults=" + path("f.json"), "--store",
           path("s.db"), "-o", path("c.gt3x")});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_THAT(answer.people, HasSubstr("the unit's clock was wrong"));
  EXPECT_THAT(answer.people, testing::Not(HasSubstr("--calibration-file")));
}

// Before the unit is asked: the rates of docs/protocol.md.
TEST_F(CommandTest, CaptureRefusesARateThatNoUnitHas) {
  for (const char* rate : {"29", "33", "45", "99", "110", "30.5", ""}) {
    EXPECT_EQ(run({"capture", "--device", "virtual:foo=1", "-o", path("c.gt3x"), "--rate", rate})
                  .people.find("foo"),
              std::string::npos)
        << rate;
    EXPECT_EQ(run({"capture", "--device", kDevice, "-o", path("c.gt3x"), "--rate", rate}).exit_code,
              64)
        << rate;
  }
  for (const char* rate : {"30", "40", "100"}) {
    EXPECT_THAT(
        run({"capture", "--device", "virtual:foo=1", "-o", path("c.gt3x"), "--rate", rate}).people,
        HasSubstr("foo"))
        << rate;
  }
}

// "stop" and "n" were taken for "the unit lies there", and the recording went on.
TEST_F(CommandTest, CaptureGoesOnBehindAnEmptyLineAlone) {
  const auto capture = [&](const std::string& name, const std::string& typed) {
    return tests::run_command(posix_env(),
                              {"capture", "--device", kDevice, "--jig", "manual", "--store",
                               path("s.db"), "-o", path(name)},
                              typed);
  };
  for (const char* word : {"s", "q", "stop"}) {
    const auto stopped = capture(std::string(word) + ".gt3x", std::string(word) + "\n\n\n");
    EXPECT_EQ(stopped.exit_code, 3) << word;
    EXPECT_THAT(stopped.people, HasSubstr("side 1 of 6")) << word;
    EXPECT_THAT(stopped.people, testing::Not(HasSubstr("side 2 of 6"))) << word;
  }
  const auto asked = capture("n.gt3x", "n\nu\n\nnein\n");
  EXPECT_EQ(asked.exit_code, 3);
  EXPECT_THAT(asked.people, HasSubstr("'n' is no word here; Enter alone: it lies there; s and "
                                      "Enter: stop"));
  EXPECT_THAT(asked.people, HasSubstr("side 2 of 6"));
  EXPECT_THAT(asked.people, HasSubstr("'nein' is no word here"));
  EXPECT_THAT(asked.people, testing::Not(HasSubstr("side 3 of 6")));
}

TEST_F(CommandTest, CaptureRefusesAFirmwareWhoseFileCannotHelp) {
  const auto answer = run({"capture", "--device", "virtual:seed=7,firmware=1.8.0,jig=auto", "-o",
                           path("c.gt3x"), "--store", path("s.db"), "--json"});
  EXPECT_EQ(answer.exit_code, 1);
  const nlohmann::json json = nlohmann::json::parse(answer.out);
  EXPECT_EQ(json["verdict"], "refused");
  EXPECT_EQ(json["filter"], "legacy");
  EXPECT_THAT(json["reasons"].dump(), HasSubstr("firmware from 1.4.0 to 1.7.0"));
}

// Oracle: the keys of `solve` for a file without constants.
TEST_F(CommandTest, CaptureWithoutAResultHasTheKeysOfSolve) {
  const auto solved = run({"capture", "--device", kDevice, "--jig", "virtual", "--store",
                           path("s.db"), "-o", path("c.gt3x"), "--json"});
  const auto refused = run({"capture", "--device", "virtual:seed=7,firmware=1.8.0,jig=auto", "-o",
                            path("d.gt3x"), "--store", path("s.db"), "--json"});
  const auto stopped = tests::run_command(posix_env(),
                                          {"capture", "--device", kDevice, "--jig", "manual",
                                           "--store", path("s.db"), "-o", path("e.gt3x"), "--json"},
                                          "s\n");
  for (const auto& json : {refused.json(), stopped.json()}) {
    for (const char* key :
         {"serial", "filter", "method", "constants", "standard_uncertainty", "points", "coverage_g",
          "residual_mg", "verified", "verdict", "reasons", "missing_directions", "notes",
          "iterations", "seconds", "file", "sha256", "stored_id"}) {
      EXPECT_TRUE(json.contains(key)) << key;
      EXPECT_TRUE(solved.json().contains(key)) << key;
    }
    EXPECT_TRUE(json["method"].is_null());
    EXPECT_TRUE(json["constants"].is_null());
    EXPECT_EQ(json["points"], 0);
    EXPECT_TRUE(json["residual_mg"]["before"].is_null());
    EXPECT_EQ(json["missing_directions"], Json::array());
    EXPECT_EQ(json["verified"], false);
  }
  EXPECT_EQ(refused.json()["verdict"], "refused");
  EXPECT_EQ(stopped.json()["verdict"], "stopped");
  EXPECT_EQ(stopped.json()["serial"], "MOS2A45130007");
}

}  // namespace
}  // namespace sixpoint::cli
