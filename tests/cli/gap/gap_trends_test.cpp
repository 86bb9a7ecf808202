// sixpoint gap trends by its contract; tests/station/records has the decision itself.
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

TEST_F(GapTrends, AStoreWithoutRunsSaysSo) {
  db::Store::open(posix_env(), path("s.db")).value();
  const auto answer = trends();
  EXPECT_EQ(answer.exit_code, 2);
  EXPECT_EQ(answer.out, "");
  EXPECT_THAT(answer.people, HasSubstr("holds no jig run"));
}

}  // namespace
}  // namespace sixpoint::cli
