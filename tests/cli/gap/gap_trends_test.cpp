// sixpoint gap trends by its contract; tests/station/records has the decision itself.
#include <fstream>

#include <fmt/format.h>

#include "cli/command_fixture.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::CommandTest;

class GapTrends : public CommandTest {
 protected:
  tests::Answer trends(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"gap", "trends", "--store", path("s.db")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  void measure(const std::string& jig) {
    ASSERT_EQ(run({"jig", "--device", tests::kUnitInJig, "--jig-id", jig, "--store", path("s.db")})
                  .exit_code,
              0);
  }
};

// 66 is EX_NOINPUT, and nothing is made by asking.
TEST_F(GapTrends, NeedsAStore) {
  EXPECT_EQ(trends().exit_code, 66);
  EXPECT_EQ(trends({"--json"}).json()["error"]["code"], "no_input");
  EXPECT_EQ(trends().exit_code, 66);
}

// Docs: 2 is inconclusive. One unit, however often it is measured, cannot say whose a skew is.
TEST_F(GapTrends, OneUnitIsTooFew) {
  measure("J1");
  measure("J1");
  measure("J2");
  const auto answer = trends({"--json"});
  EXPECT_EQ(answer.exit_code, 2);
  const nlohmann::ordered_json json = answer.json();
  EXPECT_EQ(json["schema"], "sixpoint/gap-trends/1");
  EXPECT_EQ(json["runs"], 3);
  ASSERT_EQ(json["jigs"].size(), 2U);
  EXPECT_EQ(json["jigs"][0]["jig"], "J1");
  EXPECT_EQ(json["jigs"][0]["units"], 1);
  EXPECT_EQ(json["jigs"][0]["runs"], 2);
  EXPECT_EQ(json["jigs"][0]["belongs_to"], "too_few_units");
  EXPECT_TRUE(json["jigs"][0]["chance"].is_null()) << "nothing was decided";
  EXPECT_EQ(json["jigs"][1]["runs"], 1);
  EXPECT_THAT(trends().out, HasSubstr("too few units"));
}

// Hidden in the virtual jigs: J1's base leans by 0.3 degree, J3's face +x by 0.4. The units are the
// simulator's, the runs the program's own.
TEST_F(GapTrends, HiddenCausesOfVirtualJigsAreFound) {
  const std::array<std::string, 3> settings = {"lean_deg=0.3", "lean_deg=0",
                                               "worn=+x,worn_deg=0.4"};
  for (int unit = 0; unit < 9; ++unit) {
    const int jig = unit % 3;
    ASSERT_EQ(run({"jig", "--device", fmt::format("virtual:seed={},jig=auto", unit + 1), "--jig",
                   fmt::format("virtual:serial=J{},{}", jig + 1,
                               settings.at(static_cast<std::size_t>(jig))),
                   "--jig-id", fmt::format("J{}", jig + 1), "--store", path("s.db")})
                  .exit_code,
              0);
  }
  const auto answer = trends({"--json"});
  EXPECT_EQ(answer.exit_code, 1);
  const nlohmann::ordered_json json = answer.json();
  EXPECT_EQ(json["units"], 9);
  EXPECT_EQ(json["units_without_lot"], 9);
  ASSERT_EQ(json["jigs"].size(), 3U);
  const std::map<std::string, std::string> expected = {
      {"J1", "jig"}, {"J2", "none"}, {"J3", "face"}};
  for (const auto& jig : json["jigs"]) {
    EXPECT_EQ(jig["belongs_to"], expected.at(jig["jig"]));
    EXPECT_EQ(jig["faces"].size(), 6U);
    EXPECT_TRUE(jig["chance"].is_null()) << "three units";
    if (jig["jig"] == "J1") {
      EXPECT_NEAR(jig["tilt_deg"], 0.3, 0.02);
    }
    if (jig["jig"] == "J3") {
      EXPECT_EQ(jig["faces"][2]["face"], "+x");
      EXPECT_TRUE(jig["faces"][2]["is_off"]);
      EXPECT_NEAR(jig["faces"][2]["size_deg"], 0.4, 0.03);
    }
  }
  const auto people = trends();
  EXPECT_THAT(people.people, HasSubstr("face +x of jig J3 reads 0."));
  EXPECT_THAT(people.people, HasSubstr("clean or replace it"));
  EXPECT_THAT(people.people, HasSubstr("jig J1 tilts all units by "));
  EXPECT_THAT(people.people, HasSubstr("--lots"));
}

TEST_F(GapTrends, LotsComeFromAFile) {
  measure("J1");
  std::ofstream(path("lots.csv")) << "serial,lot\nMOS2A45130007,2013-11\n";
  const auto answer = trends({"--lots", path("lots.csv"), "--json"});
  EXPECT_EQ(answer.exit_code, 2) << "one unit is too few";
  EXPECT_EQ(answer.json()["units_without_lot"], 0);
  ASSERT_EQ(answer.json()["lots"].size(), 1U);
  EXPECT_EQ(answer.json()["lots"][0]["lot"], "2013-11");
  EXPECT_EQ(answer.json()["lots"][0]["units"], 1);
  std::ofstream(path("lots.csv")) << "serial\nA\n";
  EXPECT_EQ(trends({"--lots", path("lots.csv")}).exit_code, 65);
  EXPECT_EQ(trends({"--lots", path("none.csv")}).exit_code, 66);
}

TEST_F(GapTrends, AStoreWithoutRunsSaysSo) {
  db::Store::open(posix_env(), path("s.db")).value();
  const auto answer = trends();
  EXPECT_EQ(answer.exit_code, 2);
  EXPECT_EQ(answer.out, "");
  EXPECT_THAT(answer.people, HasSubstr("holds no jig run"));
}

}  // namespace
}  // namespace sixpoint::cli
