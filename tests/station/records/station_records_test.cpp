#include "station/records/station_records.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "expect_result.h"
#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::Contains;
using testing::HasSubstr;
using Json = nlohmann::ordered_json;

// A store with runs as jig runs leave them, one an hour.
class StationRecords : public testing::Test {
 protected:
  StationRecords() : store_(*db::Store::open(env_.env, folder_ / "s.db")) {}

  void add_run(const std::string& serial, JigVerdict verdict, double zero_mg = 100,
               const std::string& station = "A", const std::string& study = {}) {
    env_.clock.set(env_.clock.now() + std::chrono::hours(1));
    Json document = {{"firmware", "1.5.0"}, {"quantities", Json::array()}};
    if (!study.empty()) {
      document["study"] = study;
    }
    for (const char* axis : {"x", "y", "z"}) {
      for (const char* name : {"sensitivity_deviation_percent", "zero_offset_mg"}) {
        document["quantities"].push_back(
            {{"name", name},
             {"axis", axis},
             {"value", std::string(name) == "zero_offset_mg" ? zero_mg : 3.0},
             {"expanded_uncertainty", 0.7},
             {"low", -700},
             {"high", 700},
             {"verdict", "pass"},
             {"code", ""}});
      }
    }
    db::RunRecord run;
    run.serial = serial;
    run.model = "wGT3X-BT";
    run.kind = study.empty() ? "jig" : kStudyKind;
    run.filter = "current";
    run.started = env_.clock.now();
    run.ended = env_.clock.now() + std::chrono::seconds(90);
    run.operator_name = study.empty() ? "Ada" : station;
    run.station = station;
    run.jig = "J1";
    run.verdict = to_string(verdict);
    run.software = "test";
    run.document = document.dump();
    if (!is_passed(verdict)) {
      run.codes = {"zero_high"};
    }
    ASSERT_OK(store_.add_run(run, {}));
  }
  void decide(const std::string& action, const std::string& serial = {},
              const std::string& station = "A") {
    env_.clock.set(env_.clock.now() + std::chrono::minutes(10));
    db::StationEvent event;
    event.station = station;
    event.serial = serial;
    event.action = action;
    event.operator_name = "Eve";
    event.reason = "looked at it";
    ASSERT_OK(store_.add_station_event(event));
  }
  // Ten runs of a check unit with a scatter of a milligravity.
  void baseline(const std::string& serial = "CHECK1", const std::string& station = "A") {
    for (int i = 0; i < 10; ++i) {
      add_run(serial, JigVerdict::pass, 100 + (i % 2 == 0 ? 0.5 : -0.5), station);
    }
  }
  Result<RetestState> start(const std::string& serial, const std::string& station = "A") {
    return may_start(store_, serial, station, default_limits());
  }

  tests::TemporaryFolder folder_;
  struct Place {
    Place() : env{clock, posix_env().files} { clock.set(*parse_iso8601("2026-01-01")); }
    ManualClock clock;
    Env env;
  } env_;
  db::Store store_;
};

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

TEST_F(StationRecords, ThePageHoldsWhatItSaysAndEscapesNames) {
  decide("check_unit", "CHECK1");
  baseline();
  add_run("CHECK1", JigVerdict::pass, 110);
  for (int i = 0; i < 6; ++i) {
    add_run("MOS2A" + std::to_string(i), i == 0 ? JigVerdict::fail : JigVerdict::pass, 90 + i,
            "<script>alert(1)</script>");
  }
  const auto report = statistics(*summaries(store_, {}), "station");
  const auto state = station_state(store_, "A", default_limits().check_unit);
  const std::string html = statistics_html(*report, {*state});
  EXPECT_THAT(html, HasSubstr("83.3 %"));
  EXPECT_THAT(html, HasSubstr("zero_high"));
  EXPECT_THAT(html, HasSubstr("class=locked"));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("nan"), std::string::npos);
}

}  // namespace
}  // namespace sixpoint::station
