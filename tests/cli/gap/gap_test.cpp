// sixpoint gap diagnose and trends by their contract; tests/gap has the diagnosis itself.
#include <filesystem>
#include <fstream>

#include "base/atomic_file.h"
#include "cli/command_fixture.h"
#include "expect_result.h"

namespace sixpoint {
namespace {

using tests::CommandTest;

TEST_F(CommandTest, DiagnosisOfASimulatedBundleFindsNoGap) {
  std::ofstream(path("s.json"))
      << R"({"schema": "sixpoint/scenario/1", "seed": 3, "protocol": "production"})";
  ASSERT_EQ(run({"simulate", "--scenario", path("s.json"), "-o", path("bundle")}).exit_code, 0);
  const auto answer = run({"gap", "diagnose", path("bundle"), "--html", path("r.html"),
                           "--scenario-out", path("augmented.json"), "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const auto json = answer.json();
  EXPECT_EQ(json["schema"], "sixpoint/gap-diagnose/1");
  EXPECT_EQ(json["verdict"], "no_gap");
  EXPECT_TRUE(std::filesystem::exists(path("r.html")));
  // The augmented scenario is one that `simulate` takes.
  EXPECT_EQ(run({"simulate", "--scenario", path("augmented.json"), "-o", path("again")}).exit_code,
            0);
}

// The scenario of a diagnosis makes the recording's own protocol again: its rate, poses and their
// order. Oracle: protocol.json.
TEST_F(CommandTest, TheScenarioOfADiagnosisHasTheRecordingsOwnProtocol) {
  std::ofstream(path("s.json"))
      << R"({"schema": "sixpoint/scenario/1", "seed": 3, "protocol": "production",
      "rate_hz": 30, "effects": [{"name": "misalignment", "parameters": {"rotation_vector_deg": [0.8, -0.6, 0.7]}}]})";
  ASSERT_EQ(run({"simulate", "--scenario", path("s.json"), "-o", path("bundle")}).exit_code, 0);
  const auto protocol_of = [&](const std::string& bundle) {
    std::ifstream in(path(bundle + "/protocol.json"));
    return nlohmann::json::parse(in);
  };
  // As a jig that does less, in its own order.
  auto short_one = protocol_of("bundle");
  auto& segments = short_one["segments"];
  segments.erase(segments.begin() + 1);
  segments.erase(segments.end() - 1);
  std::ofstream(path("bundle/protocol.json")) << short_one;
  const auto found =
      run({"gap", "diagnose", path("bundle"), "--scenario-out", path("a.json"), "--json"});
  EXPECT_EQ(found.exit_code, 0) << found.people;
  std::ifstream written(path("a.json"));
  EXPECT_EQ(nlohmann::ordered_json::parse(written), found.json()["augmented_scenario"]);
  const auto made = run({"simulate", "--scenario", path("a.json"), "-o", path("again")});
  ASSERT_EQ(made.exit_code, 0) << made.people;
  const auto again = protocol_of("again");
  EXPECT_EQ(again["sample_rate_hz"], 30);
  ASSERT_EQ(again["segments"].size(), segments.size());
  for (std::size_t i = 0; i < segments.size(); ++i) {
    EXPECT_EQ(again["segments"][i]["name"], segments[i]["name"]);
    EXPECT_EQ(again["segments"][i]["samples"], segments[i]["samples"]);
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t column = 0; column < 3; ++column) {
        EXPECT_NEAR(again["segments"][i]["rotation"][row][column].get<double>(),
                    segments[i]["rotation"][row][column].get<double>(), 1e-9);
      }
    }
  }
  const auto found_again = run({"gap", "diagnose", path("again"), "--json"}).json();
  EXPECT_EQ(found_again["effects"][0]["name"], "misalignment");
  EXPECT_FALSE(found_again["unknown"]["present"]) << found_again["unknown"];
}

// A unit of 341 LSB/g is simulated again as one.
TEST_F(CommandTest, TheScenarioOfADiagnosisHasTheRecordingsScale) {
  std::ofstream(path("s.json"))
      << R"({"seed": 7, "rate_hz": 50, "protocol": "production", "unit": {"accel_scale_lsb_per_g": 341}})";
  ASSERT_EQ(run({"simulate", "--scenario", path("s.json"), "-o", path("bundle")}).exit_code, 0);
  const auto found = run({"gap", "diagnose", path("bundle"), "--scenario-out", path("again.json")});
  ASSERT_EQ(found.exit_code, 0) << found.out << found.people;
  ASSERT_EQ(run({"simulate", "--scenario", path("again.json"), "-o", path("again")}).exit_code, 0);
  std::ifstream in(path("again/protocol.json"));
  EXPECT_EQ(nlohmann::json::parse(in)["accel_scale_lsb_per_g"], 341);
}

// Two poses fit any gains and offsets.
TEST_F(CommandTest, TooFewPosesAreNoAnswer) {
  std::ofstream(path("s.json"))
      << R"({"schema": "sixpoint/scenario/1", "seed": 3, "protocol": "production"})";
  ASSERT_EQ(run({"simulate", "--scenario", path("s.json"), "-o", path("bundle")}).exit_code, 0);
  std::ifstream in(path("bundle/protocol.json"));
  auto protocol = nlohmann::json::parse(in);
  auto& segments = protocol["segments"];
  segments.erase(segments.begin() + 2, segments.end());
  std::ofstream(path("bundle/protocol.json")) << protocol;
  const auto found = run({"gap", "diagnose", path("bundle"), "--json"});
  EXPECT_EQ(found.exit_code, 2) << found.out;
  EXPECT_TRUE(found.json()["inconclusive"]);
  EXPECT_EQ(found.json()["verdict"], "unexplained");
  EXPECT_EQ(found.json()["gap"]["before"]["rms_mg"], found.json()["gap"]["after"]["rms_mg"]);
}

TEST_F(CommandTest, GapRefusesWhatItCannotRead) {
  const auto neither = run({"gap", "diagnose", "--json"});
  EXPECT_EQ(neither.exit_code, 64) << "neither BUNDLE nor --run";
  EXPECT_EQ(neither.json()["error"]["code"], "usage");
  EXPECT_EQ(run({"gap", "diagnose", path("none")}).exit_code, 66);
  EXPECT_EQ(run({"gap", "diagnose", "b", "--run", "x"}).exit_code, 64) << "both";
  EXPECT_EQ(run({"gap", "diagnose", "--run", "x", "--store", path("none.db")}).exit_code, 66);
  EXPECT_EQ(run({"gap", "trends", "--store", path("none.db")}).exit_code, 66);
  EXPECT_EQ(run({"gap"}).exit_code, 64);
}

TEST(GapCommand, TakesATableOfReadings) {
  tests::TemporaryFolder folder;
  const std::string table = folder / "t.csv";
  ASSERT_OK(write_file(posix_env().files, table, "x,y,z\n1,2,3\n"));
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose", table}).exit_code, 64);
  const auto found =
      tests::run_command(posix_env(), {"gap", "diagnose", table, "--rate", "30", "--json"});
  EXPECT_EQ(found.exit_code, 2);
  EXPECT_TRUE(found.json()["augmented_scenario"].is_null());
  const std::string scenario = folder / "s.json";
  EXPECT_EQ(tests::run_command(
                posix_env(), {"gap", "diagnose", table, "--rate", "30", "--scenario-out", scenario})
                .exit_code,
            64)
      << "no protocol says what to simulate";
  EXPECT_FALSE(std::filesystem::exists(scenario));
}

}  // namespace
}  // namespace sixpoint
