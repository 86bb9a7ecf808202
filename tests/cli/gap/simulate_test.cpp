// sixpoint simulate by its contract, on the real disk.
#include <fstream>

#include "cli/command_fixture.h"

namespace sixpoint::cli {
namespace {

using tests::CommandTest;

TEST_F(CommandTest, SimulateMakesTheSameBytes) {
  std::ofstream(path("s.json"))
      << R"({"seed": 3, "motions": [{"kind": "free_living", "duration_s": 120}]})";
  const auto first = run({"simulate", "--scenario", path("s.json"), "-o", path("a.gt3x"), "--truth",
                          path("a.csv"), "--json"});
  EXPECT_EQ(first.exit_code, 0) << first.people;
  const auto second =
      run({"simulate", "--scenario", path("s.json"), "-o", path("b.gt3x"), "--json"});
  const nlohmann::json json = nlohmann::json::parse(first.out);
  EXPECT_EQ(json["sha256"], nlohmann::json::parse(second.out)["sha256"]);
  EXPECT_EQ(first.people, "");
  const auto odd = run({"simulate", "--scenario", path("s.json"), "-o", path("bdl"), "--json"});
  EXPECT_EQ(odd.exit_code, 0);
  EXPECT_THAT(odd.people, testing::HasSubstr("names that end with .gt3x alone"));
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
  EXPECT_EQ(run({"simulate", "--scenario", path("bad.json"), "-o", path("c.gt3x")}).exit_code, 78);
  EXPECT_EQ(run({"simulate", "--scenario", path("none.json"), "-o", path("c.gt3x")}).exit_code, 66);
  EXPECT_EQ(run({"simulate", "--scenario", path("s.json"), "-o", path("no/c.gt3x")}).exit_code, 73);
}

}  // namespace
}  // namespace sixpoint::cli
