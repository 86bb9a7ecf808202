// sixpoint jig by its contract, on the real disk.
#include "cli/command_fixture.h"

namespace sixpoint::cli {
namespace {

using tests::CommandTest;
using tests::kDevice;

// Oracle: the sensor that the device string names.
TEST_F(CommandTest, JigFindsTheSensorAndStoresIt) {
  const auto answer = run({"jig", "--device", kDevice, "--jig", "virtual", "--store", path("s.db"),
                           "--operator", "A", "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const nlohmann::json json = nlohmann::json::parse(answer.out);
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

  const auto history = run({"history", "MOS2A45130007", "--store", path("s.db"), "--json"});
  EXPECT_EQ(history.exit_code, 0);
  const nlohmann::json constants = nlohmann::json::parse(history.out)["constants"];
  ASSERT_EQ(constants.size(), 1U);
  EXPECT_EQ(constants[0]["id"], json["stored_id"]);
  EXPECT_EQ(constants[0]["filter"], "current");
  EXPECT_EQ(run({"audit", "verify", "--store", path("s.db")}).exit_code, 0);
}

TEST_F(CommandTest, JigRefusesByTheContractsCodes) {
  const auto code_of = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"jig", "--store", path("s.db")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments).exit_code;
  };
  EXPECT_EQ(code_of({"--device", "virtual:colour=red"}), 64);
  EXPECT_EQ(code_of({"--device", "serial:1"}), 64);
  EXPECT_EQ(code_of({"--device", kDevice, "--jig", "robot"}), 64);
  EXPECT_EQ(code_of({"--device", kDevice, "--jig", "virtual", "--filter", "new"}), 64);
  EXPECT_EQ(code_of({"--device", kDevice, "--jig", "virtual", "--filter", "legacy"}), 64);
  EXPECT_EQ(code_of({"--device", kDevice, "--jig", "manual"}), 2)
      << "the unit is never turned: inconclusive";
  EXPECT_EQ(code_of({}), 64);
}

}  // namespace
}  // namespace sixpoint::cli
