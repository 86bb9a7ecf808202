#include "station/records/station_records.h"

#include <gmock/gmock.h>

#include "base/random.h"
#include "expect_result.h"
#include "station/records/made_station.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

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

// The table of add_decision, row by row.
TEST_F(StationRecords, ADecisionIsSignedAndRemovesOnlyACheckUnit) {
  db::StationEvent decision;
  decision.serial = "CHECK1";
  decision.action = "check_unit";
  decision.reason = "stays here";
  EXPECT_FAILS(add_decision(store_, decision), ErrorCode::usage);
  decision.operator_name = "Eve";
  decision.reason = " \t";
  EXPECT_FAILS(add_decision(store_, decision), ErrorCode::usage);
  decision.reason = "stays here";
  decision.action = "check_unit_end";
  EXPECT_FAILS(add_decision(store_, decision), ErrorCode::no_input);
  decision.action = "check_unit";
  ASSERT_OK(add_decision(store_, decision));
  decision.action = "check_unit_end";
  decision.serial = "CHECK2";
  EXPECT_FAILS(add_decision(store_, decision), ErrorCode::no_input);
  decision.serial = "CHECK1";
  const auto id = add_decision(store_, decision);
  ASSERT_OK(id);
  EXPECT_FAILS(add_decision(store_, decision), ErrorCode::no_input);  // it is none any more
  decision.action = "release";
  decision.serial = "MISTYPED";
  EXPECT_FAILS(add_decision(store_, decision), ErrorCode::no_input);
  decision.serial = "MOS2A1";
  add_run("MOS2A1", JigVerdict::fail);
  EXPECT_OK(add_decision(store_, decision));
  const auto events = store_.station_events();
  ASSERT_OK(events);
  EXPECT_EQ(events->size(), 3U);
}

// The table of the header, row by row.
TEST_F(StationRecords, AKnownBadUnitMustFailAsItIsKnownTo) {
  const auto locked = [&](const std::string& station = "A") {
    return station_state(store_, station, default_limits().check_unit, env_.clock.now())->locked;
  };
  name_known_bad("BAD1");
  EXPECT_TRUE(locked()) << "not measured in this shift";
  EXPECT_FALSE(locked("B")) << "it was named for A";
  add_run("BAD1", JigVerdict::fail);  // with zero_high
  EXPECT_FALSE(locked());
  env_.clock.set(env_.clock.now() + kShift + std::chrono::hours(1));
  EXPECT_TRUE(locked()) << "the next shift";
  add_run("BAD1", JigVerdict::pass);
  EXPECT_TRUE(locked()) << "the station does not find what is wrong";
  add_run("BAD1", JigVerdict::inconclusive);
  EXPECT_TRUE(locked());
  add_run("BAD1", JigVerdict::fail);
  EXPECT_FALSE(locked());
  add_run("BAD1", JigVerdict::pass);
  EXPECT_TRUE(locked());
  decide("sign");
  EXPECT_TRUE(locked()) << "a signature does not open this lock";
  add_run("BAD1", JigVerdict::fail);
  EXPECT_FALSE(locked());
  EXPECT_FAILS(reason_with_codes("zero_hihg", "x"), ErrorCode::usage);
  EXPECT_FAILS(reason_with_codes("", "x"), ErrorCode::usage);
  EXPECT_TRUE(codes_in_reason("expects nothing: really").empty());
  const std::vector<std::string> two = {"noise_high", "zero_high"};
  EXPECT_EQ(codes_in_reason(*reason_with_codes("zero_high,noise_high", "x")), two);
}

// Removed, and named again without codes.
TEST_F(StationRecords, AKnownBadUnitThatCeasesLiftsNoLock) {
  const auto state = [&] {
    return station_state(store_, "A", default_limits().check_unit, env_.clock.now()).value();
  };
  for (const char* ceases : {"check_unit_end", "check_unit"}) {
    env_.clock.set(env_.clock.now() + kShift + std::chrono::hours(1));
    name_known_bad("BAD1");
    EXPECT_TRUE(state().locked) << "not measured in this shift";
    decide(ceases, "BAD1");
    EXPECT_FALSE(state().locked) << "and need not be any more";
    name_known_bad("BAD1");
    add_run("BAD1", JigVerdict::fail);  // with zero_high
    decide(ceases, "BAD1");
    env_.clock.set(env_.clock.now() + kShift + std::chrono::hours(1));
    EXPECT_FALSE(state().locked) << "it had set none, and sets none any more";
    name_known_bad("BAD1");
    add_run("BAD1", JigVerdict::pass);
    decide(ceases, "BAD1");
    ASSERT_TRUE(state().locked) << ceases;
    EXPECT_THAT(state().reasons[0], HasSubstr("it was removed since: an engineer signs"));
    EXPECT_TRUE(state().to_json()["known_bad"].empty());
    add_run("BAD1", JigVerdict::fail);
    EXPECT_TRUE(state().locked) << "what it does afterwards counts no more";
    decide("sign");
    EXPECT_FALSE(state().locked) << ceases;
  }
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

TEST_F(StationRecords, TheRemovalOfACheckUnitLiftsNoLock) {
  decide("check_unit", "CHECK1");
  baseline();
  add_run("CHECK1", JigVerdict::pass, 200);
  decide("check_unit_end", "CHECK1");
  EXPECT_FAILS(start("MOS2A1"), ErrorCode::configuration);
  EXPECT_FAILS(start("CHECK1"), ErrorCode::configuration);  // it is a unit as any other now
  decide("sign");
  EXPECT_OK(start("MOS2A1"));
  add_run("CHECK1", JigVerdict::pass, 300);
  EXPECT_OK(start("MOS2A1")) << "it watches nothing any more";
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

// The rows of may_write()'s table.
TEST_F(StationRecords, OnlyConstantsThatApplyAreWrittenAfterwards) {
  db::ConstantsRecord constants;
  constants.serial = "MOS2A1";
  constants.filter = "current";
  constants.method = "jig";
  constants.document = "{}";
  constants.made_at = from_unix_seconds(100);
  const auto id = store_.add_constants(constants, "wGT3X-BT");
  ASSERT_OK(id);
  Result<db::Store> store = std::move(store_);
  const std::string others(32, 'a');
  const auto may = [&](const std::string& constants_id, bool is_in_journal) {
    const auto never = may_write(store, "MOS2A1", constants_id, is_in_journal);
    EXPECT_OK(never);
    return never->value_or(Error{});
  };
  for (const bool is_in_journal : {false, true}) {
    EXPECT_EQ(may(*id, is_in_journal).what, "");
  }
  EXPECT_THAT(may(others, false).what, HasSubstr("does not hold these constants"));
  EXPECT_EQ(may(others, true).what, "");
  ASSERT_OK(store->withdraw_constants(*id, "Ada", "jig out of level"));
  for (const bool is_in_journal : {false, true}) {
    EXPECT_THAT(may(*id, is_in_journal).what, HasSubstr("jig out of level"));
  }
  for (const ErrorCode code : {ErrorCode::io, ErrorCode::no_input, ErrorCode::configuration}) {
    Result<db::Store> away = fail(code, "the store cannot be opened", {}, "see to it");
    EXPECT_FAILS(may_write(away, "MOS2A1", *id, false), code);
    const auto never = may_write(away, "MOS2A1", *id, true);
    ASSERT_OK(never);
    EXPECT_FALSE(never->has_value());
  }
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

// Oracle: counted by hand. What a unit was before and after it checked the station counts.
TEST_F(StationRecords, ARunOfACheckUnitNeverCountsAndItsOtherRunsAlwaysDo) {
  add_run("UNIT1", JigVerdict::pass);
  decide("check_unit", "UNIT1");
  add_run("UNIT1", JigVerdict::fail);
  add_run("UNIT1", JigVerdict::fail, 100, "B");
  decide("check_unit_end", "UNIT1");
  add_run("MOS2A1", JigVerdict::pass);
  const auto runs = summaries(store_, {});
  ASSERT_OK(runs);
  ASSERT_EQ(runs->size(), 2U);
  EXPECT_EQ((*runs)[0].serial, "UNIT1");
  EXPECT_EQ((*runs)[1].serial, "MOS2A1");
  const auto report = statistics(*runs, "");
  EXPECT_EQ(report->all.yield.count, 2U);
  EXPECT_TRUE(report->all.failure_codes.empty());
  const auto yield = store_.yield(UtcTime::min(), UtcTime::max());
  ASSERT_OK(yield);
  EXPECT_EQ(yield->runs, 2U);
  EXPECT_EQ(yield->passed, 2U);
}

// Oracle: the rows of the table of YieldReport, counted by hand; the two commands that say a yield.
TEST_F(StationRecords, TheYieldOfTheStoreIsThatOfTheStatistics) {
  add_run("NEVER", JigVerdict::stopped);
  add_run("NEVER", JigVerdict::inconclusive);
  add_run("FIRST", JigVerdict::pass);
  add_run("FIRST", JigVerdict::inconclusive);
  add_run("SECOND", JigVerdict::stopped);
  add_run("SECOND", JigVerdict::conditional_fail);
  add_run("SECOND", JigVerdict::conditional_pass);
  add_run("LATER", JigVerdict::inconclusive);
  add_run("LATER", JigVerdict::pass);
  add_run("LOST", JigVerdict::pass);
  add_run("LOST", JigVerdict::fail);
  add_run("LOST", JigVerdict::stopped);
  const auto yield = store_.yield(UtcTime::min(), UtcTime::max());
  ASSERT_OK(yield);
  EXPECT_EQ(yield->judged, 4U);
  EXPECT_EQ(yield->passed, 3U);
  EXPECT_EQ(yield->passed_first_time, 3U);
  const auto runs = summaries(store_, {});
  ASSERT_OK(runs);
  const auto all = statistics(*runs, "")->all;
  EXPECT_EQ(all.runs, yield->runs);
  EXPECT_EQ(all.units, yield->units);
  EXPECT_EQ(all.yield.of, yield->judged);
  EXPECT_EQ(all.yield.count, yield->passed);
  EXPECT_EQ(all.first_pass_yield.of, yield->judged);
  EXPECT_EQ(all.first_pass_yield.count, yield->passed_first_time);
  EXPECT_EQ(all.yield.value(), yield->yield());
  EXPECT_EQ(all.first_pass_yield.value(), yield->first_pass_yield());
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

}  // namespace
}  // namespace sixpoint::station
