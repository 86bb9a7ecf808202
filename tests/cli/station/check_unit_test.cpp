// check-unit, station-lock and retest by their contract; tests/station/records has the rules.
#include <filesystem>

#include <fmt/format.h>

#include "cli/station/station_fixture.h"

namespace sixpoint::station {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::StartsWith;

TEST_F(StationCommands, JigRefusesToStartAtALockedStation) {
  const std::string check =
      "serial=MOS2A00000001,true_sensitivity_lsb_per_g=240/240/240,"
      "true_zero_lsb=20/20/20,seed=";
  const auto added =
      run({"check-unit", "add", "MOS2A00000001", "--operator", "Eve", "--reason", "watch"});
  ASSERT_EQ(added.exit_code, 0);
  EXPECT_THAT(added.people, HasSubstr("MOS2A00000001: the store knows no such unit"));
  EXPECT_THAT(run({"history", "MOS2A00000001"}).out, HasSubstr("watch (Eve)"))
      << "before its first run";
  EXPECT_EQ(run({"check-unit", "remove", "MOS2A0000000", "--operator", "Eve", "--reason", "typo"})
                .exit_code,
            66)
      << "a digit is missing";
  write("l.toml", "[check_unit]\nbaseline_runs = 4\n");
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(measure(check + std::to_string(i + 1)).exit_code, 0);
  }
  const std::vector<std::string> limits = {"--limits", folder_ / "l.toml"};
  EXPECT_EQ(measure("seed=9", limits).exit_code, 0);
  // The check unit changes by 5 mg: or is it the jig?
  EXPECT_EQ(measure("serial=MOS2A00000001,true_sensitivity_lsb_per_g=240/240/240,"
                    "true_zero_lsb=21.2/20/20,seed=8",
                    limits)
                .exit_code,
            0);
  const auto refused = measure("seed=9", limits);
  EXPECT_EQ(refused.exit_code, 78);
  std::vector<std::string> nameless = {"jig", "--device", "virtual:seed=9,jig=auto"};
  nameless.insert(nameless.end(), limits.begin(), limits.end());
  EXPECT_EQ(run(nameless).exit_code, 78) << "left out";
  nameless.insert(nameless.end(), {"--station", "a"});
  EXPECT_EQ(run(nameless).exit_code, 78) << "spelt otherwise";
  EXPECT_THAT(refused.people, HasSubstr("station A is locked"));
  EXPECT_THAT(refused.people, HasSubstr("station-lock sign"));
  EXPECT_EQ(refused.json()["error"]["code"], "configuration");
  auto status =
      run({"station-lock", "status", "--station", "A", "--limits", folder_ / "l.toml", "--json"});
  EXPECT_EQ(status.exit_code, 1);
  EXPECT_TRUE(status.json()["locked"].get<bool>());
  EXPECT_EQ(run({"station-lock", "sign", "--station", "A"}).exit_code, 64) << "who, and why?";
  const auto sign_at = [&](const char* station) {
    return run({"station-lock", "sign", "--station", station, "--operator", "Eve", "--reason",
                "seat cleaned"});
  };
  EXPECT_THAT(sign_at("B").out, HasSubstr("is its name right?"));
  EXPECT_EQ(measure("seed=9", limits).exit_code, 78);
  EXPECT_THAT(sign_at("A").out, StartsWith("signed; station A is open"));
  EXPECT_EQ(measure("seed=9", limits).exit_code, 0);
  const auto chart = run({"check-unit", "chart", "--station", "A", "--limits", folder_ / "l.toml",
                          "--html", folder_ / "c.html", "--json"});
  EXPECT_EQ(chart.exit_code, 0);
  EXPECT_EQ(chart.json()["charts"].size(), 6U);
  EXPECT_GT(std::filesystem::file_size(folder_ / "c.html"), 1000U);
}

// Oracle: the code in the name of the defect, and no other.
TEST_F(StationCommands, AKnownBadUnitOpensTheStationByFailing) {
  int seed = 100;
  for (const char* defect : {"zero_high", "zero_low", "sensitivity_low", "sensitivity_high"}) {
    const auto failed = measure(fmt::format("seed={},bad={}", ++seed, defect));
    EXPECT_EQ(failed.exit_code, 1) << defect;
    EXPECT_EQ(failed.json()["codes"], cli::Json::array({defect}));
  }
  ASSERT_EQ(run({"check-unit", "add", "MOS2A0BAD", "--expect", "zero_high", "--station", "A",
                 "--operator", "Eve", "--reason", "dropped"})
                .exit_code,
            0);
  EXPECT_THAT(
      run({"station-lock", "sign", "--station", "A", "--operator", "Eve", "--reason", "x"}).out,
      StartsWith("signed; station A is locked"))
      << "a signature does not open this lock";
  EXPECT_EQ(run({"check-unit", "add", "MOS2A0BAD", "--expect", "zero_hihg", "--station", "A",
                 "--operator", "Eve", "--reason", "dropped"})
                .exit_code,
            64);
  const auto locked = measure("seed=9");
  EXPECT_EQ(locked.exit_code, 78);
  EXPECT_THAT(locked.people, HasSubstr("it must fail with zero_high"));
  EXPECT_EQ(measure("seed=5,serial=MOS2A0BAD,bad=zero_high").exit_code, 1);
  EXPECT_EQ(measure("seed=9").exit_code, 0);
  EXPECT_EQ(measure("seed=5,serial=MOS2A0BAD").exit_code, 0) << "it does not fail";
  EXPECT_EQ(measure("seed=9").exit_code, 78);
  EXPECT_EQ(measure("seed=6,serial=MOS2A0BAD,bad=sensitivity_low").exit_code, 1) << "another code";
  EXPECT_EQ(measure("seed=9").exit_code, 78);
  EXPECT_EQ(measure("seed=7,serial=MOS2A0BAD,bad=zero_high").exit_code, 1) << "just that code";
  EXPECT_EQ(measure("seed=9").exit_code, 0);
}

TEST_F(StationCommands, AUnitThatFailedIsMeasuredTwiceAndNotForever) {
  write("tight.toml", "[zero_offset_mg]\nlow = -1\nhigh = 1\n");
  const std::vector<std::string> tight = {"--limits", folder_ / "tight.toml"};
  const std::string unit = "seed=9,serial=MOS2A00000009";
  EXPECT_EQ(measure(unit, tight).exit_code, 1);
  const auto first = measure(unit);
  EXPECT_EQ(first.exit_code, 0);
  EXPECT_EQ(first.json()["verdict"], "conditional_pass");
  EXPECT_THAT(first.json()["codes"], Contains("retest"));
  EXPECT_EQ(measure(unit).json()["verdict"], "pass");
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(measure(unit, tight).exit_code, 1);
  }
  std::vector<std::string> last = {"jig", "--device", "virtual:jig=auto," + unit, "--station", "A"};
  last.insert(last.end(), tight.begin(), tight.end());
  const auto third = run(last);
  EXPECT_EQ(third.exit_code, 1);
  EXPECT_THAT(third.out, HasSubstr("what to do: Keep the unit back"));
  EXPECT_THAT(third.out, testing::Not(HasSubstr("epeat")));
  EXPECT_EQ(measure(unit).exit_code, 78);
  const auto file =
      run({"capture", "--device", "virtual:jig=auto," + unit, "-o", folder_ / "c.gt3x", "--json"});
  EXPECT_EQ(file.exit_code, 78) << "another way to constants is no way around it";
  EXPECT_FALSE(std::filesystem::exists(folder_ / "c.gt3x"));
  const auto state = run({"retest", "MOS2A00000009", "--json"});
  EXPECT_EQ(state.exit_code, 1);
  EXPECT_EQ(state.json()["failures_in_row"], 3);
  EXPECT_THAT(
      run({"retest", "MOS2A00000009"}).out,
      testing::AllOf(HasSubstr("MOS2A00000009: may not be measured again: the unit failed 3"),
                     HasSubstr("sixpoint retest MOS2A00000009 --release")));
  const auto small = run({"retest", "mos2a00000009", "--json"});
  EXPECT_EQ(small.json(), state.json()) << "the same unit, as 'scan' has it";
  const auto released = run({"retest", "mos2a00000009", "--release", "--operator", "Eve",
                             "--reason", "new battery", "--json"});
  EXPECT_EQ(released.exit_code, 0);
  EXPECT_EQ(released.json()["serial"], "MOS2A00000009");
  const auto events = run({"history", "MOS2A00000009", "--json"}).json()["events"];
  ASSERT_EQ(events.size(), 1U) << events;
  EXPECT_EQ(events[0]["id"], released.json()["stored_id"]);
  EXPECT_EQ(events[0]["action"], "release");
  EXPECT_EQ(events[0]["operator"], "Eve");
  EXPECT_EQ(events[0]["reason"], "new battery");
  EXPECT_TRUE(events[0]["made_at"].is_string());
  EXPECT_THAT(run({"history", "MOS2A00000009"}).out,
              testing::ContainsRegex("released .*[0-9a-f]{12} +new battery .Eve."));
  EXPECT_EQ(measure(unit).exit_code, 0);
}

}  // namespace
}  // namespace sixpoint::station
