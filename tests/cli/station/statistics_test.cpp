// sixpoint statistics and gage-rr by their contract; tests/station/statistics has the numbers.
#include <fstream>

#include "cli/command_fixture.h"

namespace sixpoint {
namespace {

using tests::CommandTest;

TEST_F(CommandTest, StatisticsCountsTheRunsOfTheStore) {
  const std::string store = path("a.db");
  for (const char* station : {"east", "east", "west"}) {
    ASSERT_EQ(run({"jig", "--device", tests::kUnitInJig, "--station", station, "--store", store})
                  .exit_code,
              0);
  }
  const auto answer =
      run({"statistics", "--by", "station", "--html", path("p.html"), "--store", store, "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const auto json = answer.json();
  EXPECT_EQ(json["schema"], "sixpoint/statistics/1");
  ASSERT_EQ(json["groups"].size(), 2U);
  EXPECT_EQ(json["groups"][0]["runs"], 2);
  EXPECT_EQ(json["groups"][1]["runs"], 1);
  EXPECT_EQ(json["all"]["runs"], 3);
  EXPECT_EQ(json["all"]["units"], 1);
  EXPECT_TRUE(std::ifstream(path("p.html")).good());
  EXPECT_EQ(run({"statistics", "--from", "soon", "--store", store}).exit_code, 64);
  EXPECT_EQ(run({"statistics", "--by", "colour", "--store", store}).exit_code, 64);
  EXPECT_EQ(run({"statistics", "--store", path("none.db")}).exit_code, 66);
}

// Two parts, two operators, two readings each. All readings of a part are equal, so repeatability
// and reproducibility are zero.
TEST_F(CommandTest, GageRrReadsItsTable) {
  std::ofstream csv(path("g.csv"));
  csv << "part,operator,value\n";
  for (const char* part : {"A,", "B,"}) {
    for (const char* who : {"ada,", "max,"}) {
      for (int repeat = 0; repeat < 2; ++repeat) {
        csv << part << who << (part[0] == 'A' ? "1.0" : "2.0") << '\n';
      }
    }
  }
  csv.close();
  const auto answer = run({"gage-rr", path("g.csv"), "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_EQ(answer.json()["schema"], "sixpoint/gage-rr/1");
  EXPECT_EQ(run({"gage-rr"}).exit_code, 64) << "no readings are named";
  EXPECT_EQ(run({"gage-rr", path("none.csv")}).exit_code, 66);
}

}  // namespace
}  // namespace sixpoint
