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
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose", table, "--rate", "30"}).exit_code,
            2);
}

}  // namespace
}  // namespace sixpoint
