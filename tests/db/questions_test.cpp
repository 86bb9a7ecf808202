#include "db/questions.h"

#include <array>

#include "store_fixture.h"

namespace sixpoint::db {
namespace {

TEST_F(StoreTest, AnswersWhatPeopleAsk) {
  Store store = open();
  const auto run = [&](const std::string& serial, const std::string& verdict, std::int64_t time_s,
                       const std::string& jig = "J1") {
    RunRecord record;
    record.serial = serial;
    record.kind = "jig";
    record.filter = "current";
    record.jig = jig;
    record.verdict = verdict;
    record.started = from_unix_seconds(time_s);
    record.ended = from_unix_seconds(time_s + 60);
    record.document = "{}";
    return store.add_run(record, {}).value();
  };
  // A passes at once, B at its second run, C never; D is of another time and jig.
  const auto first = run("A", "pass", 1000);
  run("B", "fail", 1100);
  run("C", "fail", 1200);
  run("B", "pass", 1300);
  run("D", "pass", 9000, "J2");
  const auto yield = store.yield(from_unix_seconds(0), from_unix_seconds(5000));
  ASSERT_OK(yield);
  EXPECT_EQ(yield->runs, 4U);
  EXPECT_EQ(yield->units, 3U);
  EXPECT_DOUBLE_EQ(yield->yield(), 2.0 / 3);
  EXPECT_DOUBLE_EQ(yield->first_pass_yield(), 1.0 / 3);
  EXPECT_TRUE(std::isnan(store.yield(from_unix_seconds(0), from_unix_seconds(1))->yield()));

  // The runs of a check unit do not count, also when it is one no more.
  StationEvent event;
  event.serial = "C";
  event.operator_name = "Eve";
  event.reason = "golden";
  for (const auto& [action, time_s] : {std::pair("check_unit", 1150), {"check_unit_end", 1250}}) {
    event.action = action;
    memory_.clock.set(from_unix_seconds(time_s));
    ASSERT_OK(store.add_station_event(event));
    EXPECT_EQ(store.yield(from_unix_seconds(0), from_unix_seconds(5000))->units, 2U) << action;
  }

  const auto of_jig = store.units_of_jig("J1");
  ASSERT_EQ(of_jig->size(), 3U);
  EXPECT_EQ((*of_jig)[1].serial, "B");
  EXPECT_EQ((*of_jig)[1].runs, 2U);
  EXPECT_EQ((*of_jig)[1].last_verdict, "pass");
  EXPECT_EQ((*of_jig)[1].last_run, from_unix_seconds(1360));

  auto of_a = constants("A", "current", 1060);
  of_a.run_id = first;
  const auto old_set = store.add_constants(of_a, "w").value();
  const auto new_set = store.add_constants(constants("A", "current", 4000), "w").value();
  ASSERT_OK(store.add_constants(constants("B", "current", 1360), "w"));
  RepairRecord repair;
  repair.document = "{}";
  repair.serial = "A";
  for (const auto& [input, id] :
       {std::pair("one", old_set), {"two", new_set}, {"three", old_set}}) {
    repair.input = input;
    repair.constants_id = id;
    ASSERT_OK(store.add_repair(repair));
  }
  EXPECT_TRUE(store.recall_list()->empty());
  ASSERT_OK(store.withdraw_constants(old_set, "Ada", "jig out of level"));
  ASSERT_OK(store.withdraw_constants(old_set, "Bob", "again"));
  const auto recall = store.recall_list();
  ASSERT_EQ(recall->size(), 2U);
  EXPECT_EQ((*recall)[0].repair.input, "one");
  EXPECT_EQ((*recall)[1].repair.input, "three");
  EXPECT_EQ((*recall)[1].reason, "jig out of level");
  EXPECT_EQ(store.recall_list(old_set)->size(), 2U);
  EXPECT_TRUE(store.recall_list(new_set)->empty());
  // The same file again: with the set that is withdrawn, and later with the other one.
  repair.input = "three, moved";
  for (const auto& [time, id, again] : {std::tuple(5000, old_set, false), {6000, new_set, true}}) {
    repair.input_sha256 = "3";
    repair.constants_id = id;
    repair.made_at = from_unix_seconds(time);
    ASSERT_OK(store.add_repair(repair));
    const auto last = store.recall_list()->back();
    EXPECT_EQ(last.repair.input_sha256, "3");
    EXPECT_EQ(last.repaired_again_at.has_value(), again) << time;
  }
  EXPECT_EQ(store.recall_list()->back().repaired_again_at, from_unix_seconds(6000));
  EXPECT_EQ(recall->front().repaired_again_at, std::nullopt) << "two files of unknown hash";

  const auto trend = store.trend("A");
  ASSERT_EQ(trend->size(), 2U);
  EXPECT_EQ((*trend)[0].jig, "J1");
  EXPECT_TRUE((*trend)[0].withdrawn);
  EXPECT_EQ((*trend)[1].jig, "");
  EXPECT_FALSE((*trend)[1].withdrawn);

  // C and D have no constants, B's are old, A's new ones are not.
  const auto due = store.units_due(from_unix_seconds(2000));
  ASSERT_EQ(due->size(), 3U);
  EXPECT_EQ((*due)[0].serial, "C");
  EXPECT_FALSE((*due)[0].last_constants.has_value());
  EXPECT_EQ((*due)[1].serial, "D");
  EXPECT_EQ((*due)[2].serial, "B");
}

// The rows of the table of the header.
TEST(CheckUnitTimes, FollowTheTable) {
  std::vector<StationEvent> events;
  const auto decide = [&](const std::string& action, std::int64_t time_s,
                          const std::string& station) {
    events.push_back({"", from_unix_seconds(time_s), station, "A", action, "Eve", "why"});
  };
  const auto held = [&](const std::string& serial = "A") {  // of the runs at 5, 10, 15 ... 35
    const CheckUnitTimes times(events);
    std::vector<int> seconds;
    for (int time_s = 5; time_s <= 35; time_s += 5) {
      if (times.hold(serial, from_unix_seconds(time_s))) {
        seconds.push_back(time_s);
      }
    }
    return seconds;
  };
  using Seconds = std::vector<int>;
  decide("release", 5, "1");
  EXPECT_EQ(held(), Seconds());
  decide("check_unit", 10, "1");
  EXPECT_EQ(held(), (Seconds{10, 15, 20, 25, 30, 35}));
  EXPECT_EQ(held("B"), Seconds());
  decide("check_unit_end", 20, "2");
  EXPECT_EQ(held(), (Seconds{10, 15}));
  decide("check_unit", 30, "2");
  EXPECT_EQ(held(), (Seconds{10, 15, 30, 35}));
  events.pop_back();
  events.pop_back();
  decide("check_unit", 15, "2");
  decide("check_unit_end", 25, "2");
  EXPECT_EQ(held(), (Seconds{10, 15, 20}));
}

TEST(UnitHistory, IsEmptyWhereNothingIsKnownOfTheUnit) {
  EXPECT_TRUE(UnitHistory().empty());
  std::array<UnitHistory, 5> known;
  known[0].constants.resize(1);
  known[1].runs.resize(1);
  known[2].writes.resize(1);
  known[3].repairs.resize(1);
  known[4].corrections.resize(1);
  for (const UnitHistory& history : known) {
    EXPECT_FALSE(history.empty());
  }
}

TEST_F(StoreTest, ARetestIsCountedAsOne) {
  Store store = open();
  RunRecord run = jig_run("A");
  run.verdict = "fail";
  run.started = from_unix_seconds(10);
  run.retest_of = "";
  const std::string first = store.add_run(run, {}).value();
  run.verdict = "pass";
  run.started = from_unix_seconds(20);
  run.retest_of = first;
  ASSERT_OK(store.add_run(run, {}));
  const auto yield = store.yield(from_unix_seconds(0), from_unix_seconds(99));
  ASSERT_OK(yield);
  EXPECT_EQ(yield->runs, 2U);
  EXPECT_EQ(yield->retests, 1U);
  EXPECT_EQ(yield->passed, 1U);
  EXPECT_EQ(yield->passed_first_time, 0U);
}

}  // namespace
}  // namespace sixpoint::db
