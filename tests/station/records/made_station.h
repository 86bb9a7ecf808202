// A store as the jig runs and the decisions at a station leave it.
#pragma once

#include <chrono>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "db/store.h"
#include "expect_result.h"
#include "station/limits/limits.h"
#include "station/records/station_records.h"
#include "temporary_folder.h"

namespace sixpoint::tests {

// A store with runs as jig runs leave them, one an hour.
class StationRecords : public testing::Test {
 protected:
  StationRecords() : store_(*db::Store::open(env_.env, folder_ / "s.db")) {}

  void add_run(const std::string& serial, station::JigVerdict verdict, double zero_mg = 100,
               const std::string& station = "A", const std::string& study = {}) {
    env_.clock.set(env_.clock.now() + std::chrono::hours(1));
    nlohmann::ordered_json document = {{"firmware", "1.5.0"},
                                       {"quantities", nlohmann::ordered_json::array()}};
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
    run.kind = study.empty() ? "jig" : station::kStudyKind;
    run.filter = "current";
    run.started = env_.clock.now();
    run.ended = env_.clock.now() + std::chrono::seconds(90);
    run.operator_name = study.empty() ? "Ada" : station;
    run.station = station;
    run.jig = "J1";
    run.verdict = station::to_string(verdict);
    run.software = "test";
    run.document = document.dump();
    if (!station::is_passed(verdict)) {
      run.codes = {"zero_high"};
    }
    ASSERT_OK(store_.add_run(run, {}));
  }
  void decide(const std::string& action, const std::string& serial = {},
              const std::string& station = "A", const std::string& reason = "looked at it") {
    env_.clock.set(env_.clock.now() + std::chrono::minutes(10));
    db::StationEvent event;
    event.station = station;
    event.serial = serial;
    event.action = action;
    event.operator_name = "Eve";
    event.reason = reason;
    ASSERT_OK(store_.add_station_event(event));
  }
  void name_known_bad(const std::string& serial) {
    decide("check_unit", serial, "A", *station::reason_with_codes("zero_high", "dropped"));
  }
  // Ten runs of a check unit with a scatter of a milligravity.
  void baseline(const std::string& serial = "CHECK1", const std::string& station = "A") {
    for (int i = 0; i < 10; ++i) {
      add_run(serial, station::JigVerdict::pass, 100 + (i % 2 == 0 ? 0.5 : -0.5), station);
    }
  }
  Result<station::RetestState> start(const std::string& serial, const std::string& station = "A") {
    return station::may_start(store_, serial, station, station::default_limits());
  }

  TemporaryFolder folder_;
  struct Place {
    Place() : env{clock, posix_env().files} { clock.set(*parse_iso8601("2026-01-01")); }
    ManualClock clock;
    Env env;
  } env_;
  db::Store store_;
};

}  // namespace sixpoint::tests
