#include "station/records/station_records.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "expect_result.h"
#include "run_command.h"
#include "station/records/made_station.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::Contains;
using testing::HasSubstr;
using Json = nlohmann::ordered_json;

using tests::StationRecords;

TEST_F(StationRecords, ACheckUnitOutOfControlLocksItsStationUntilAnEngineerSigns) {
  decide("check_unit", "CHECK1");
  baseline();
  EXPECT_OK(start("MOS2A1"));
  add_run("CHECK1", JigVerdict::pass, 101);
  EXPECT_OK(start("MOS2A1"));
  add_run("CHECK1", JigVerdict::pass, 104);  // 4.5 sigma
  const auto locked = start("MOS2A1");
  EXPECT_FAILS(locked, ErrorCode::configuration);
  EXPECT_THAT(locked.error().what,
              HasSubstr("station A is locked; check unit CHECK1, Zero offset"));
  EXPECT_THAT(locked.error().hint, HasSubstr("station-lock sign"));
  EXPECT_OK(start("CHECK1")) << "a check unit may always be measured";
  EXPECT_OK(start("MOS2A1", "B")) << "another station is not concerned";
  add_run("CHECK1", JigVerdict::pass, 100);
  EXPECT_FAILS(start("MOS2A1"), ErrorCode::configuration);  // one good point does not unlock it
  decide("sign");
  EXPECT_OK(start("MOS2A1"));
  const auto state = station_state(store_, "A", default_limits().check_unit);
  EXPECT_FALSE(state->locked);
  EXPECT_EQ(state->signature->operator_name, "Eve");
  EXPECT_EQ(state->charts.size(), 6U);
  add_run("CHECK1", JigVerdict::pass, 105);
  EXPECT_FAILS(start("MOS2A1"), ErrorCode::configuration);
}

TEST_F(StationRecords, ANewBaselineForgetsTheOldOne) {
  decide("check_unit", "CHECK1");
  baseline();
  add_run("CHECK1", JigVerdict::pass, 200);
  EXPECT_FAILS(start("MOS2A1"), ErrorCode::configuration);
  decide("sign_new_baseline");
  add_run("CHECK1", JigVerdict::pass, 200);
  EXPECT_OK(start("MOS2A1"));
  const auto state = station_state(store_, "A", default_limits().check_unit);
  EXPECT_EQ(state->charts[0].chart.values.size(), 1U);
  EXPECT_EQ(state->charts[0].chart.baseline, 0U);
}

TEST_F(StationRecords, AUnitThatIsNoCheckUnitAnyMoreLocksNothing) {
  decide("check_unit", "CHECK1");
  baseline();
  add_run("CHECK1", JigVerdict::pass, 200);
  decide("check_unit_end", "CHECK1");
  EXPECT_OK(start("MOS2A1"));
}

TEST_F(StationRecords, TheRetestPolicyHoldsOverTheStoresRuns) {
  add_run("MOS2A1", JigVerdict::fail);
  auto state = start("MOS2A1");
  ASSERT_OK(state);
  EXPECT_EQ(state->passes_needed, 2);
  EXPECT_FALSE(state->retest_of.empty());
  add_run("MOS2A1", JigVerdict::fail);
  add_run("MOS2A1", JigVerdict::conditional_fail);
  const auto refused = start("MOS2A1");
  EXPECT_FAILS(refused, ErrorCode::configuration);
  EXPECT_THAT(refused.error().hint, HasSubstr("retest MOS2A1 --release"));
  EXPECT_OK(start("MOS2A2"));
  decide("release", "MOS2A1");
  EXPECT_OK(start("MOS2A1"));
  add_run("MOS2A1", JigVerdict::fail);
  EXPECT_OK(start("MOS2A1"));
}

TEST_F(StationRecords, CheckUnitsAndStudiesAreNoStatistics) {
  decide("check_unit", "CHECK1");
  baseline();
  add_run("MOS2A1", JigVerdict::pass);
  add_run("MOS2A2", JigVerdict::fail);
  add_run("MOS2A3", JigVerdict::fail, 100, "A", "spring");
  const auto runs = summaries(store_, {});
  ASSERT_OK(runs);
  ASSERT_EQ(runs->size(), 2U);
  EXPECT_EQ((*runs)[0].serial, "MOS2A1");
  EXPECT_EQ((*runs)[0].seconds, 90);
  EXPECT_EQ((*runs)[0].firmware, "1.5.0");
  EXPECT_EQ((*runs)[1].codes, std::vector<std::string>{"zero_high"});
  EXPECT_EQ((*runs)[0].quantities.size(), 6U);
}

TEST_F(StationRecords, AGageStudyIsReadBackByItsName) {
  Random random(7);
  for (int part = 0; part < 5; ++part) {
    for (const char* person : {"Ada", "Bo"}) {
      for (int trial = 0; trial < 2; ++trial) {
        add_run("MOS2A" + std::to_string(part), JigVerdict::pass, 100 * part + random.normal(),
                person, "spring");
      }
    }
  }
  const auto readings = gage_readings(store_, "spring", "zero_offset_mg", "x");
  ASSERT_OK(readings);
  EXPECT_EQ(readings->size(), 20U);
  const auto report = gage_rr(*readings);
  ASSERT_OK(report);
  EXPECT_TRUE(report->usable()) << report->brief();
  EXPECT_FAILS(gage_readings(store_, "autumn", "zero_offset_mg", "x"), ErrorCode::no_input);
  EXPECT_FAILS(gage_readings(store_, "spring", "beauty", "x"), ErrorCode::usage);
}

TEST_F(StationRecords, EventsAreChainedAndNeedAName) {
  db::StationEvent event;
  event.station = "A";
  event.action = "sign";
  EXPECT_FAILS(store_.add_station_event(event), ErrorCode::usage);
  event.operator_name = "Eve";
  event.reason = "why";
  event.action = "unlock";
  EXPECT_FAILS(store_.add_station_event(event), ErrorCode::usage);
  event.action = "check_unit";
  EXPECT_FAILS(store_.add_station_event(event), ErrorCode::bad_data);  // no serial
  decide("sign");
  const auto audit = store_.audit();
  EXPECT_TRUE(audit->ok) << audit->brief();
}

// --- the commands, on the real disk with virtual units ---

class StationCommands : public testing::Test {
 protected:
  tests::Answer run(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--store", folder_ / "s.db"});
    return tests::run_command(posix_env(), arguments);
  }
  tests::Answer measure(const std::string& unit, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {
        "jig",       "--device", "virtual:" + unit, "--jig", "virtual",
        "--station", "A",        "--operator",      "Ada",   "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  void write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
  }
  tests::TemporaryFolder folder_;
};

TEST_F(StationCommands, JigRefusesToStartAtALockedStation) {
  const std::string check =
      "serial=MOS2A00000001,true_sensitivity_lsb_per_g=240/240/240,"
      "true_zero_lsb=20/20/20,seed=";
  ASSERT_EQ(run({"check-unit", "add", "MOS2A00000001", "--operator", "Eve", "--reason", "watch"})
                .exit_code,
            0);
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
  EXPECT_THAT(refused.people, HasSubstr("station A is locked"));
  EXPECT_THAT(refused.people, HasSubstr("station-lock sign"));
  EXPECT_EQ(refused.json()["error"]["code"], "configuration");
  auto status =
      run({"station-lock", "status", "--station", "A", "--limits", folder_ / "l.toml", "--json"});
  EXPECT_EQ(status.exit_code, 1);
  EXPECT_TRUE(status.json()["locked"].get<bool>());
  EXPECT_EQ(run({"station-lock", "sign", "--station", "A"}).exit_code, 64) << "who, and why?";
  EXPECT_EQ(run({"station-lock", "sign", "--station", "A", "--operator", "Eve", "--reason",
                 "seat cleaned"})
                .exit_code,
            0);
  EXPECT_EQ(measure("seed=9", limits).exit_code, 0);
  const auto chart = run({"check-unit", "chart", "--station", "A", "--limits", folder_ / "l.toml",
                          "--html", folder_ / "c.html", "--json"});
  EXPECT_EQ(chart.exit_code, 0);
  EXPECT_EQ(chart.json()["charts"].size(), 6U);
  EXPECT_GT(std::filesystem::file_size(folder_ / "c.html"), 1000U);
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
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(measure(unit, tight).exit_code, 1);
  }
  EXPECT_EQ(measure(unit).exit_code, 78);
  const auto state = run({"retest", "MOS2A00000009", "--json"});
  EXPECT_EQ(state.exit_code, 1);
  EXPECT_EQ(state.json()["failures_in_row"], 3);
  EXPECT_EQ(
      run({"retest", "MOS2A00000009", "--release", "--operator", "Eve", "--reason", "new battery"})
          .exit_code,
      0);
  EXPECT_EQ(measure(unit).exit_code, 0);
}

TEST_F(StationCommands, StatisticsAndTheGageStudy) {
  for (int part = 1; part <= 3; ++part) {
    for (const char* person : {"Ada", "Bo"}) {
      for (int trial = 0; trial < 2; ++trial) {
        const auto answer = run({"jig", "--device", "virtual:seed=" + std::to_string(part), "--jig",
                                 "virtual", "--operator", person, "--study", "spring"});
        EXPECT_EQ(answer.exit_code, 0) << answer.people;
      }
    }
    EXPECT_EQ(measure("seed=" + std::to_string(part)).exit_code, 0);
  }
  const auto gage = run({"gage-rr", "--study", "spring", "--axis", "y", "--json"});
  EXPECT_EQ(gage.exit_code, 0) << gage.people << gage.out;
  EXPECT_EQ(gage.json()["parts"], 3);
  EXPECT_LT(gage.json()["grr_percent"].get<double>(), 5);
  const auto statistics =
      run({"statistics", "--by", "station", "--html", folder_ / "s.html", "--json"});
  EXPECT_EQ(statistics.exit_code, 0);
  EXPECT_EQ(statistics.json()["all"]["runs"], 3) << "the study's runs do not count";
  EXPECT_EQ(statistics.json()["groups"][0]["name"], "A");
  EXPECT_TRUE(statistics.json()["capability"].contains("zero_offset_mg x"));
  EXPECT_EQ(run({"statistics", "--by", "moon"}).exit_code, 64);
  EXPECT_EQ(run({"gage-rr", "--study", "autumn"}).exit_code, 66);
  EXPECT_EQ(run({"gage-rr"}).exit_code, 64);
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
}  // namespace sixpoint::station
