// simulate, jig, capture by their contract, on the real disk.
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

tests::Answer run_command(const std::vector<std::string>& arguments) {
  return tests::run_command(posix_env(), arguments);
}

constexpr const char* kDevice =
    "virtual:seed=7,serial=MOS2A45130007,firmware=1.5.0,calibrated=2013-11-12,"
    "positive_lsb=311/310/287,negative_lsb=-204/-216/-234,zero_lsb=54/47/26,"
    "true_sensitivity_lsb_per_g=237.7/251.8/242.3,true_zero_lsb=49.9/95.8/60.8";

class BenchCommands : public testing::Test {
 protected:
  std::string path(const std::string& name) { return folder_ / name; }
  tests::TemporaryFolder folder_;
};

// Oracle: the sensor that the device string names.
TEST_F(BenchCommands, JigFindsTheSensorAndStoresIt) {
  const auto answer = run_command({"jig", "--device", kDevice, "--jig", "virtual", "--store",
                                   path("s.db"), "--operator", "A", "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const Json json = Json::parse(answer.out);
  EXPECT_EQ(json.begin().key(),
            "as_found");  // nlohmann::json sorts; the document itself is ordered
  EXPECT_EQ(answer.out.find("\"schema\": \"sixpoint/jig/1\""), 4U);
  EXPECT_EQ(json["serial"], "MOS2A45130007");
  EXPECT_EQ(json["filter"], "current");
  EXPECT_EQ(json["verdict"], "pass");
  EXPECT_EQ(json["poses"].size(), 6U);
  const double sensitivity[] = {237.7, 251.8, 242.3};
  const double zero[] = {49.9, 95.8, 60.8};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(1 / json["constants"]["sensitivity_g_per_lsb"][axis].get<double>(),
                sensitivity[axis], 0.3);
    EXPECT_NEAR(json["constants"]["zero_lsb"][axis].get<double>(), zero[axis], 0.3);
  }
  EXPECT_LT(json["verification"]["residual_mg"].get<double>(), 2);
  EXPECT_TRUE(json["certificate"].is_null());
  EXPECT_FALSE(json["run"].get<std::string>().empty());

  const auto history = run_command({"history", "MOS2A45130007", "--store", path("s.db"), "--json"});
  EXPECT_EQ(history.exit_code, 0);
  const Json constants = Json::parse(history.out)["constants"];
  ASSERT_EQ(constants.size(), 1U);
  EXPECT_EQ(constants[0]["id"], json["stored_id"]);
  EXPECT_EQ(constants[0]["filter"], "current");
  EXPECT_EQ(run_command({"audit", "verify", "--store", path("s.db")}).exit_code, 0);
}

TEST_F(BenchCommands, JigRefusesByTheContractsCodes) {
  const auto run = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"jig", "--store", path("s.db")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_command(arguments).exit_code;
  };
  EXPECT_EQ(run({"--device", "virtual:colour=red"}), 64);
  EXPECT_EQ(run({"--device", "serial:1"}), 64);
  EXPECT_EQ(run({"--device", kDevice, "--jig", "robot"}), 64);
  EXPECT_EQ(run({"--device", kDevice, "--jig", "virtual", "--filter", "new"}), 64);
  EXPECT_EQ(run({"--device", kDevice, "--jig", "virtual", "--filter", "legacy"}), 64);
  EXPECT_EQ(run({"--device", kDevice, "--jig", "manual"}), 2) << "nobody turns it: inconclusive";
  EXPECT_EQ(run({}), 64);
}

TEST_F(BenchCommands, CaptureMakesACalibrationFile) {
  const auto answer =
      run_command({"capture", "--device", kDevice, "--jig", "virtual", "--store", path("s.db"),
                   "-o", path("c.gt3x"), "--constants", path("c.json"), "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const Json json = Json::parse(answer.out);
  EXPECT_EQ(json["schema"], "sixpoint/capture/1");
  EXPECT_EQ(json["verified"], true);
  EXPECT_EQ(json["file"], path("c.gt3x"));
  EXPECT_TRUE(json["stored_id"].is_string());
  // The file stands on its own: `solve` gives the same constants.
  const auto solve = run_command({"solve", path("c.gt3x"), "--json"});
  EXPECT_EQ(solve.exit_code, 0);
  EXPECT_EQ(Json::parse(solve.out)["constants"], json["constants"]);

  const auto again = run_command({"capture", "--device", kDevice, "--jig", "virtual", "--store",
                                  path("s.db"), "-o", path("c.gt3x")});
  EXPECT_EQ(again.exit_code, 73);
}

TEST_F(BenchCommands, CaptureRefusesAFirmwareWhoseFileCannotHelp) {
  const auto answer = run_command({"capture", "--device", "virtual:seed=7,firmware=1.8.0,jig=auto",
                                   "-o", path("c.gt3x"), "--store", path("s.db"), "--json"});
  EXPECT_EQ(answer.exit_code, 1);
  const Json json = Json::parse(answer.out);
  EXPECT_EQ(json["verdict"], "refused");
  EXPECT_EQ(json["filter"], "legacy");
  EXPECT_THAT(json["reasons"].dump(), HasSubstr("firmware from 1.4.0 to 1.7.0"));
}

TEST_F(BenchCommands, SimulateMakesTheSameBytes) {
  std::ofstream(path("s.json"))
      << R"({"seed": 3, "motions": [{"kind": "free_living", "duration_s": 120}]})";
  const auto first = run_command({"simulate", "--scenario", path("s.json"), "-o", path("a.gt3x"),
                                  "--truth", path("a.csv"), "--json"});
  EXPECT_EQ(first.exit_code, 0) << first.people;
  const auto second =
      run_command({"simulate", "--scenario", path("s.json"), "-o", path("b.gt3x"), "--json"});
  const Json json = Json::parse(first.out);
  EXPECT_EQ(json["sha256"], Json::parse(second.out)["sha256"]);
  EXPECT_EQ(json["samples"], 3600);
  EXPECT_EQ(json["filter"]["in_force"], "current");
  std::ifstream truth(path("a.csv"));
  std::string line;
  int lines = 0;
  while (std::getline(truth, line)) {
    ++lines;
  }
  EXPECT_EQ(lines, 3601) << "one per stored sample, and the header";

  std::ofstream(path("bad.json")) << R"({"motions": [{"kind": "fly"}]})";
  EXPECT_EQ(
      run_command({"simulate", "--scenario", path("bad.json"), "-o", path("c.gt3x")}).exit_code,
      78);
  EXPECT_EQ(
      run_command({"simulate", "--scenario", path("none.json"), "-o", path("c.gt3x")}).exit_code,
      66);
  EXPECT_EQ(
      run_command({"simulate", "--scenario", path("s.json"), "-o", path("no/c.gt3x")}).exit_code,
      73);
}

}  // namespace
}  // namespace sixpoint::cli
