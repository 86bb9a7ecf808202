// sixpoint statistics and gage-rr by their contract; tests/station/statistics has the numbers.
#include <fstream>

#include "cli/command_fixture.h"
#include "cli/station/station_fixture.h"

namespace sixpoint {
namespace {

using station::StationCommands;
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
  const auto backwards =
      run({"statistics", "--from", "2027-01-01", "--to", "2026-01-01", "--store", store});
  EXPECT_EQ(backwards.exit_code, 64);
  EXPECT_THAT(backwards.people, testing::HasSubstr("this day is after --to"));
  EXPECT_EQ(run({"statistics", "--by", "colour", "--store", store}).exit_code, 64);
  EXPECT_EQ(run({"statistics", "--store", path("none.db")}).exit_code, 66);
}

// Five units, of which one was judged by different limits of zero alone.
TEST_F(StationCommands, CpkNeedsOneSetOfLimits) {
  write("wide.toml", "[zero_offset_mg]\nlow = -2000\nhigh = 2000\n");
  const std::vector<std::string> wide = {"--limits", folder_ / "wide.toml"};
  ASSERT_EQ(measure("seed=1", wide).exit_code, 0);
  for (const char* unit : {"seed=2", "seed=3", "seed=4"}) {
    ASSERT_EQ(measure(unit).exit_code, 0);
  }
  EXPECT_THAT(run({"statistics"}).out,
              testing::AllOf(testing::HasSubstr("no Cpk of fewer than 5 units"),
                             testing::Not(testing::HasSubstr("Cpk  "))));
  ASSERT_EQ(measure("seed=5").exit_code, 0);
  const auto without = run({"statistics", "--json"});
  EXPECT_EQ(without.exit_code, 0);
  EXPECT_EQ(without.json()["limits_differ"],
            cli::Json::array({"zero_offset_mg x", "zero_offset_mg y", "zero_offset_mg z"}));
  EXPECT_FALSE(without.json()["capability"].contains("zero_offset_mg x"));
  EXPECT_TRUE(without.json()["capability"].contains("noise_mg x"));
  EXPECT_THAT(run({"statistics"}).out,
              testing::AllOf(testing::HasSubstr("(--limits FILE names some): Zero offset x, mg; "
                                                "Zero offset y, mg"),
                             testing::HasSubstr("n = 5: Noise"),
                             testing::Not(testing::HasSubstr("noise_mg"))));
  const auto with = run({"statistics", "--limits", folder_ / "wide.toml", "--json"});
  EXPECT_TRUE(with.json()["capability"].contains("zero_offset_mg x"));
  EXPECT_TRUE(with.json()["limits_differ"].empty());
}

// Two parts, two operators, two readings each, 0.01 apart, on parts that are 1 apart.
TEST_F(CommandTest, GageRrReadsItsTable) {
  std::ofstream csv(path("g.csv"));
  csv << "part,operator,value\n";
  for (const char* part : {"A,", "B,"}) {
    for (const char* who : {"ada,", "max,"}) {
      for (int repeat = 0; repeat < 2; ++repeat) {
        csv << part << who << (part[0] == 'A' ? "1.0" : "2.0") << repeat << '\n';
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

TEST_F(StationCommands, StatisticsAndTheGageStudy) {
  for (int part = 1; part <= 3; ++part) {
    for (const char* person : {"Ada", "Bo"}) {
      for (int trial = 0; trial < 2; ++trial) {
        const auto answer = run({"jig", "--device",
                                 "virtual:seed=" + std::to_string(part) + ",noise=" +
                                     std::to_string(100 * part + 10 * trial + person[0] % 2),
                                 "--jig", "virtual", "--operator", person, "--study", "spring"});
        EXPECT_EQ(answer.exit_code, 0) << answer.people;
      }
    }
    EXPECT_EQ(measure("seed=" + std::to_string(part)).exit_code, 0);
  }
  const auto gage = run({"gage-rr", "--study", "spring", "--axis", "y", "--json"});
  EXPECT_EQ(gage.exit_code, 0) << gage.people << gage.out;
  EXPECT_EQ(gage.json()["parts"], 3);
  EXPECT_LT(gage.json()["grr_percent"].get<double>(), 5);
  for (const char* quantity : {"verification_residual_mg", "tilt_deg"}) {
    const auto of_all_axes = run({"gage-rr", "--study", "spring", "--quantity", quantity});
    EXPECT_LE(of_all_axes.exit_code, 1) << quantity << ": " << of_all_axes.people;
  }
  const auto not_there = run({"gage-rr", "--study", "spring", "--quantity", "recheck_residual_mg"});
  EXPECT_EQ(not_there.exit_code, 64);
  EXPECT_THAT(not_there.people, testing::HasSubstr("of the study have no recheck_residual_mg"));
  const auto no_axis = run({"gage-rr", "--study", "spring", "--axis", "q"});
  EXPECT_EQ(no_axis.exit_code, 64);
  EXPECT_THAT(no_axis.people, testing::HasSubstr("with --axis: x, y, z"));
  const auto statistics =
      run({"statistics", "--by", "station", "--html", folder_ / "s.html", "--json"});
  EXPECT_EQ(statistics.exit_code, 0);
  EXPECT_EQ(statistics.json()["all"]["runs"], 3) << "the study's runs do not count";
  EXPECT_EQ(statistics.json()["groups"][0]["name"], "A");
  EXPECT_TRUE(statistics.json()["capability"].empty()) << "three units";
  EXPECT_EQ(run({"statistics", "--by", "moon"}).exit_code, 64);
  EXPECT_EQ(run({"gage-rr", "--study", "autumn"}).exit_code, 66);
  EXPECT_EQ(run({"gage-rr"}).exit_code, 64);
}

}  // namespace
}  // namespace sixpoint
