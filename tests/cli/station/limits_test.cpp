// sixpoint limits by its contract; tests/station/limits has the rules themselves.
#include <fstream>

#include "cli/command_fixture.h"
#include "cli/station/station_fixture.h"

namespace sixpoint {
namespace {

using station::StationCommands;
using testing::HasSubstr;
using tests::CommandTest;

TEST_F(CommandTest, LimitsThatArePrintedAreLimitsThatAreRead) {
  const auto printed = run({"limits", "print"});
  EXPECT_EQ(printed.exit_code, 0);
  std::ofstream(path("l.toml")) << printed.out;
  const auto checked = run({"limits", "check", path("l.toml"), "--json"});
  EXPECT_EQ(checked.exit_code, 0) << checked.people;
  EXPECT_EQ(checked.json()["schema"], "sixpoint/limits/1");
  EXPECT_EQ(checked.json()["sha256"].get<std::string>().size(), 64U);
  EXPECT_EQ(checked.json()["limits"], run({"limits", "print", "--json"}).json()["limits"]);
  EXPECT_EQ(run({"limits", "print", path("l.toml")}).out, printed.out);

  EXPECT_EQ(run({"limits", "check", path("none.toml")}).exit_code, 66);
  std::ofstream(path("bad.toml")) << "this is no limits file";
  const auto bad = run({"limits", "check", path("bad.toml"), "--json"});
  EXPECT_EQ(bad.exit_code, 78);
  EXPECT_THAT(bad.json()["error"]["where"].get<std::string>(), testing::EndsWith("bad.toml:1"));
  EXPECT_EQ(run({"limits"}).exit_code, 64);
}

TEST_F(StationCommands, LimitsAreCheckedAndPrinted) {
  const auto limits = [&](const std::vector<std::string>& arguments) {
    return tests::run_command(posix_env(), arguments);
  };
  write("own.toml", limits({"limits", "print"}).out);
  EXPECT_EQ(limits({"limits", "check", folder_ / "own.toml"}).exit_code, 0);
  EXPECT_EQ(limits({"limits", "print", folder_ / "own.toml"}).out, limits({"limits", "print"}).out);
  write("bad.toml", "[noise_mg]\nhigh = 3\nlow = 4\n");
  const auto bad = limits({"limits", "check", folder_ / "bad.toml", "--json"});
  EXPECT_EQ(bad.exit_code, 78);
  EXPECT_THAT(bad.json()["error"]["where"], HasSubstr("bad.toml:3"));
}

}  // namespace
}  // namespace sixpoint
