#include "db/store.h"

#include "store_fixture.h"

namespace sixpoint::db {
namespace {

TEST_F(StoreTest, KeepsConstantsPerSerialAndFilterWithTheirHistory) {
  std::string first;
  {
    Store store = open();
    first = store.add_constants(constants("MOS2A1", "current", 100, R"({"n":1})"), "w").value();
    ASSERT_OK(store.add_constants(constants("MOS2A1", "legacy", 200, R"({"n":2})"), "w"));
    ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 300, R"({"n":3})"), "w"));
    ASSERT_OK(store.add_constants(constants("MOS2A2", "current", 400, R"({"n":4})"), "w"));
  }
  Store store = open();
  const auto sets = store.constants_history("MOS2A1");
  ASSERT_OK(sets);
  ASSERT_EQ(sets->constants.size(), 3U);
  EXPECT_EQ(sets->constants[2].document, R"({"n":3})");
  EXPECT_EQ(sets->constants[2].made_at, from_unix_seconds(300));
  EXPECT_EQ(sets->constants[1].filter, "legacy");
  EXPECT_EQ(store.constants_history("MOS2A2")->constants.size(), 1U);
  EXPECT_TRUE(store.constants_history("MOS2A3")->constants.empty());
  const auto history = store.history("MOS2A1");
  ASSERT_OK(history);
  ASSERT_EQ(history->size(), 3U);
  EXPECT_EQ(history->front().id, first);
  const auto units = store.units();
  ASSERT_EQ(units->size(), 2U);
  EXPECT_EQ(units->front().constants, 3U);
}

TEST_F(StoreTest, TheSameRowTwiceIsStoredOnce) {
  Store store = open();
  const auto record = constants("MOS2A1", "current", 100);
  const auto a = store.add_constants(record, "w");
  const auto b = store.add_constants(record, "w");
  EXPECT_EQ(a.value(), b.value());
  EXPECT_EQ(store.history("MOS2A1")->size(), 1U);
}

TEST_F(StoreTest, WithdrawnConstantsAreHistoryButApplyNoMore) {
  Store store = open();
  ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 100, "1"), "w"));
  const auto id = store.add_constants(constants("MOS2A1", "current", 200, "2"), "w");
  ASSERT_OK(store.withdraw_constants(id.value(), "Ada", "jig was out of level"));
  const auto sets = store.constants_history("MOS2A1");
  EXPECT_FALSE(sets->is_withdrawn(sets->constants[0].id));
  EXPECT_TRUE(sets->is_withdrawn(id.value()));
  EXPECT_EQ(store.history("MOS2A1")->size(), 2U);
  EXPECT_FAILS(store.withdraw_constants("nonsense", "Ada", "x"), ErrorCode::no_input);
}

TEST_F(StoreTest, ARowIsNamedByTheFirstDigitsOfItsId) {
  Store store = open();
  const auto id = store.add_constants(constants("0123456789ab", "current", 100, "1"), "w").value();
  ASSERT_EQ(id.size(), 32U);
  EXPECT_EQ(store.whole_key("constants", id).value(), id);
  EXPECT_EQ(store.whole_key("constants", shown_id(id)).value(), id);
  EXPECT_EQ(store.whole_key("constants", id.substr(0, 8)).value(), id);
  std::string capital = id;
  std::ranges::transform(capital, capital.begin(), [](unsigned char c) { return std::toupper(c); });
  ASSERT_NE(capital, id);
  EXPECT_EQ(store.whole_key("constants", capital).value(), id);
  EXPECT_EQ(store.whole_key("constants", capital.substr(0, 12)).value(), id);
  EXPECT_FAILS(store.whole_key("units", "0123456789AB"), ErrorCode::no_input);
  EXPECT_FAILS(store.whole_key("constants", id.substr(0, 7)), ErrorCode::no_input);
  EXPECT_FAILS(store.whole_key("constants", id + "0"), ErrorCode::no_input);
  EXPECT_FAILS(store.whole_key("runs", id), ErrorCode::no_input);
  EXPECT_FAILS(store.whole_key("constants", "00000000"), ErrorCode::no_input);
  EXPECT_FAILS(store.whole_key("constants", "%"), ErrorCode::no_input);
  EXPECT_FAILS(store.whole_key("constants", ""), ErrorCode::no_input);
  EXPECT_EQ(store.whole_key("units", "0123456789ab").value(), "0123456789ab");
  EXPECT_FAILS(store.whole_key("units", "0123456789a"), ErrorCode::no_input);

  // No two contents are known whose ids begin alike: rows by hand.
  const auto add_by_hand = [&](const std::string& key, std::int64_t seq) {
    return store.database().execute(
        "INSERT INTO corrections (seq, id, made_at_ns, about_table, about_id, action, operator, "
        "reason, hash) VALUES ($1, $2, 0, 'units', 'a', 'note', 'a', 'a', $3)",
        std::vector<Value>{seq, key, Bytes(32, static_cast<std::uint8_t>(seq))});
  };
  ASSERT_OK(add_by_hand("0123456789abcdef0123456789abcdef", 1001));
  EXPECT_EQ(store.whole_key("corrections", "01234567").value(), "0123456789abcdef0123456789abcdef");
  ASSERT_OK(add_by_hand("01234567ffffffffffffffffffffffff", 1002));
  EXPECT_FAILS(store.whole_key("corrections", "01234567"), ErrorCode::usage);
  EXPECT_EQ(store.whole_key("corrections", "012345678").value(),
            "0123456789abcdef0123456789abcdef");
}

TEST_F(StoreTest, ACorrectionIsANewRowWithAReason) {
  Store store = open();
  const auto id = store.add_constants(constants("MOS2A1", "current", 100, "1"), "w").value();
  RepairRecord repair;
  repair.serial = "MOS2A1";
  repair.input = "a.gt3x";
  repair.constants_id = id;
  repair.document = "{}";
  ASSERT_OK(store.add_repair(repair));
  RunRecord run = jig_run("MOS2A1");
  const auto run_id = store.add_run(run, {}).value();

  const auto word = [](const std::string& table, const std::string& row, const std::string& action,
                       const std::string& reason) {
    Correction correction;
    correction.table = table;
    correction.row_id = row;
    correction.action = action;
    correction.operator_name = "Ada";
    correction.reason = reason;
    return correction;
  };
  ASSERT_OK(store.correct(word("constants", id, "withdraw", "wrong unit")));
  EXPECT_TRUE(store.constants_history("MOS2A1")->is_withdrawn(id));
  EXPECT_EQ(store.recall_list()->size(), 1U);
  EXPECT_TRUE(store.unit_history("MOS2A1")->is_withdrawn(id));
  memory_.clock.sleep(std::chrono::seconds(1));
  ASSERT_OK(store.correct(word("constants", id, "reinstate", "it was the right one")));
  EXPECT_FALSE(store.constants_history("MOS2A1")->is_withdrawn(id));
  EXPECT_TRUE(store.recall_list()->empty());
  EXPECT_FALSE(store.trend("MOS2A1")->front().withdrawn);
  EXPECT_FALSE(store.unit_history("MOS2A1")->is_withdrawn(id));
  memory_.clock.sleep(std::chrono::seconds(1));
  ASSERT_OK(store.correct(word("constants", id, "withdraw", "no, the wrong one")));
  EXPECT_TRUE(store.constants_history("MOS2A1")->is_withdrawn(id));
  ASSERT_EQ(store.recall_list()->size(), 1U);
  EXPECT_EQ(store.recall_list()->front().reason, "no, the wrong one");
  ASSERT_OK(store.correct(word("runs", run_id, "note", "the operator was Zoë")));
  ASSERT_OK(store.correct(word("units", "MOS2A1", "note", "returned in 2015")));

  const auto history = store.unit_history("MOS2A1");
  ASSERT_OK(history);
  EXPECT_EQ(history->constants.size(), 1U);
  EXPECT_EQ(history->runs.size(), 1U);
  EXPECT_EQ(history->repairs.size(), 1U);
  ASSERT_EQ(history->corrections.size(), 5U);
  EXPECT_EQ(history->corrections[3].table, "runs");
  EXPECT_EQ(history->corrections[3].reason, "the operator was Zoë");
  EXPECT_TRUE(store.unit_history("MOS2A2")->empty());

  EXPECT_FAILS(store.correct(word("constants", "none", "withdraw", "x")), ErrorCode::no_input);
  EXPECT_FAILS(store.correct(word("runs", run_id, "withdraw", "x")), ErrorCode::usage);
  EXPECT_FAILS(store.correct(word("runs", run_id, "erase", "x")), ErrorCode::usage);
  EXPECT_FAILS(store.correct(word("runs", run_id, "note", "")), ErrorCode::usage);
  EXPECT_FAILS(store.correct(word("head; DROP TABLE runs", "1", "note", "x")), ErrorCode::usage);
  EXPECT_TRUE(store.audit()->ok);
}

TEST_F(StoreTest, TheLastPreferenceOfASetThatIsNotWithdrawnHolds) {
  Store store = open();
  const auto one = store.add_constants(constants("MOS2A1", "current", 100, "1"), "w").value();
  const auto two = store.add_constants(constants("MOS2A1", "current", 200, "2"), "w").value();
  const auto prefer = [&](const std::string& id, const std::string& why) {
    memory_.clock.sleep(std::chrono::seconds(1));
    return store.correct({"", {}, "constants", id, "prefer", "Ada", why});
  };
  EXPECT_EQ(store.constants_history("MOS2A1")->preference("current"), nullptr);
  ASSERT_OK(prefer(two, "warmed up"));
  ASSERT_OK(prefer(one, "the better jig"));
  EXPECT_EQ(store.constants_history("MOS2A1")->preference("current")->reason, "the better jig");
  EXPECT_EQ(store.constants_history("MOS2A1")->preference("legacy"), nullptr);
  ASSERT_OK(store.withdraw_constants(one, "Ada", "it was not"));
  EXPECT_EQ(store.constants_history("MOS2A1")->preference("current")->reason, "warmed up");
  EXPECT_FAILS(prefer("none", "x"), ErrorCode::no_input);
  EXPECT_FAILS(prefer(two, ""), ErrorCode::usage);
  EXPECT_FAILS(prefer(one, "it was right after all"), ErrorCode::usage);
  memory_.clock.sleep(std::chrono::seconds(1));
  ASSERT_OK(store.correct({"", {}, "constants", one, "reinstate", "Ada", "it was right"}));
  ASSERT_OK(prefer(one, "it was right after all"));
  EXPECT_TRUE(store.audit()->ok);
}

TEST_F(StoreTest, RunsKeepTheirCaptures) {
  Store store = open();
  RunRecord run = jig_run("MOS2A1");
  const auto id = store.add_run(run, {{"raw", Bytes{1, 2, 3}}, {"again", Bytes{1, 2, 3}}});
  ASSERT_OK(id);
  auto with_run = constants("MOS2A1", "current", 5);
  with_run.run_id = id.value();
  ASSERT_OK(store.add_constants(with_run, "w"));
  EXPECT_EQ(store.history("MOS2A1")->front().run_id, id.value());
  const auto audit = store.audit();
  ASSERT_OK(audit);
  EXPECT_TRUE(audit->ok) << audit->brief();
  EXPECT_EQ(audit->rows, 6) << "unit, filter, run, two captures, constants";
}

TEST_F(StoreTest, TheDatabaseItselfRefusesToChangeHistory) {
  {
    Store store = open();
    ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 100), "w"));
  }
  EXPECT_TRUE(place_->statements("main", "SELECT 1"));
  EXPECT_FALSE(place_->statements("main", "UPDATE constants SET serial='X'"));
  EXPECT_FALSE(place_->statements("main", "DELETE FROM constants"));
}

TEST_F(StoreTest, RefusesWhatItCannotKeep) {
  Store store = open();
  EXPECT_FAILS(store.add_constants(constants("", "current", 1), "w"), ErrorCode::bad_data);
  EXPECT_FAILS(store.add_constants(constants("a\nb", "current", 1), "w"), ErrorCode::bad_data);
  EXPECT_FAILS(store.add_constants(constants(std::string(10'000, 'a'), "current", 1), "w"),
               ErrorCode::bad_data);
  EXPECT_FAILS(store.add_constants(constants("MOS", "new", 1), "w"), ErrorCode::bad_data);
  EXPECT_FAILS(store.add_constants(constants("MOS", "current", 1, "{"), "w"), ErrorCode::bad_data);
  RepairRecord of_nothing;
  of_nothing.serial = "MOS";
  of_nothing.constants_id = "none";
  of_nothing.document = "{}";
  EXPECT_FAILS(store.add_repair(of_nothing), ErrorCode::bad_data);
  of_nothing.constants_id = "";
  EXPECT_OK(store.add_repair(of_nothing)) << "a refusal is not said again to the next";
  ASSERT_OK(store.add_constants(constants("O'Hara\"; DROP TABLE units;--", "current", 1), "w"));
  EXPECT_EQ(store.units()->front().serial, "O'Hara\"; DROP TABLE units;--");
}

TEST_F(StoreTest, KeepsOddTextsAsTheyAre) {
  Store store = open();
  const std::string odd = "Zo\u00eb '; -- \\x41 $1 \U0001F600 \"\n\t";
  RunRecord run = jig_run("MOS2A1");
  run.operator_name = odd;
  run.document = R"({"text":"\u0000\\"})";
  ASSERT_OK(store.add_run(run, {{odd, Bytes{0, 1, 255, '\\', '\''}}}));
  const auto rows = store.database().query("SELECT operator, document FROM runs");
  EXPECT_EQ(text_of((*rows)[0][0]), odd);
  EXPECT_EQ(text_of((*rows)[0][1]), run.document);
  run.operator_name = std::string("a\0b", 3);
  EXPECT_FAILS(store.add_run(run, {}), ErrorCode::bad_data);
  for (const char* broken : {"\xff", "\xc0\x80", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xe2\x82"}) {
    run.operator_name = broken;
    EXPECT_FAILS(store.add_run(run, {}), ErrorCode::bad_data);
  }
  RepairRecord repair;
  repair.serial = "MOS2A1";
  repair.input = "/data/\xff\xfe.gt3x";
  repair.document = "{}";
  ASSERT_OK(store.add_repair(repair));
  const auto kept = store.repair_of_output("");
  ASSERT_TRUE(kept->has_value());
  EXPECT_EQ((*kept)->input, "/data/\\xff\\xfe.gt3x") << "a file's name is evidence: escaped";
  EXPECT_TRUE(store.audit()->ok);
}

TEST_F(StoreTest, KeepsWhatARunWasJudgedBy) {
  Store store = open();
  RunRecord run = jig_run("MOS2A1");
  const auto plain = store.add_run(run, {});
  run.jig_due = from_unix_seconds(1'500'000'000);
  run.build = "e21f353";
  run.limits = R"({"residual_mg":5})";
  run.gravity_m_per_s2 = 9.8101;
  run.temperature_c = 22.5;
  run.codes = {"tilted", "moved"};
  run.retest_of = plain.value();
  ASSERT_OK(store.add_run(run, {}));
  auto record = constants("MOS2A1", "current", 5);
  record.document =
      R"({"standard_uncertainty":{"zero_mg":[1,1,1]},"made_from":{"sha256":"ab"},"z":1})";
  ASSERT_OK(store.add_constants(record, "w"));
  const auto rows = store.database().query(
      "SELECT jig_due_ns, build, limits, gravity_m_per_s2, temperature_c, codes, retest_of FROM "
      "runs "
      "WHERE build IS NOT NULL");
  ASSERT_EQ(rows->size(), 1U);
  EXPECT_EQ(rows->front(),
            (Row{std::int64_t{1'500'000'000'000'000'000}, "e21f353", R"({"residual_mg":5})",
                 "9.8101", "22.5", R"(["tilted","moved"])", plain.value()}));
  const auto read = store.unit_history("MOS2A1")->runs;
  ASSERT_EQ(read.size(), 2U);
  EXPECT_FALSE(read[0].jig_due.has_value());
  EXPECT_FALSE(read[0].temperature_c.has_value());
  EXPECT_EQ(read[1].jig_due, run.jig_due);
  EXPECT_EQ(read[1].build, run.build);
  EXPECT_EQ(read[1].limits, run.limits);
  EXPECT_EQ(read[1].gravity_m_per_s2, run.gravity_m_per_s2);
  EXPECT_EQ(read[1].temperature_c, run.temperature_c);
  EXPECT_EQ(read[1].codes, run.codes);
  EXPECT_EQ(read[1].retest_of, plain.value());
  EXPECT_EQ(store.run(read[1].id)->build, run.build);
  EXPECT_FAILS(store.run("none"), ErrorCode::no_input);
  const auto history = store.history("MOS2A1");
  EXPECT_EQ(history->front().standard_uncertainty, R"({"zero_mg":[1,1,1]})");
  EXPECT_EQ(history->front().origin, R"({"sha256":"ab"})");
}

TEST_F(StoreTest, ManyWritersLoseNothing) {
  place_->location("main");
  constexpr int kWriters = 16;
  constexpr int kRows = 25;
  std::vector<std::thread> writers;
  std::vector<std::string> failures(kWriters);
  for (int writer = 0; writer < kWriters; ++writer) {
    writers.emplace_back([&, writer] {
      MemoryEnv env;
      auto store = Store::open(env.env, location());
      for (int i = 0; store && i < kRows; ++i) {
        const auto id =
            store->add_constants(constants("MOS" + std::to_string(writer), "current", i), "w");
        if (!id) {
          failures[static_cast<std::size_t>(writer)] = id.error().brief();
        }
      }
    });
  }
  for (auto& writer : writers) {
    writer.join();
  }
  EXPECT_THAT(failures, testing::Each(testing::IsEmpty()));
  const auto audit = open().audit();
  EXPECT_TRUE(audit->ok) << audit->brief();
  EXPECT_EQ(audit->rows, kWriters * (kRows + 1) + 1) << "units and constants, and the one filter";
}

TEST_F(StoreTest, ADecisionAtAStationHasANameAReasonAndAKnownAction) {
  Store store = open();
  const auto event = [](const std::string& station, const std::string& action,
                        const std::string& serial) {
    return StationEvent{"", {}, station, serial, action, "Ada", "she says so"};
  };
  for (const char* action : {"check_unit", "check_unit_end", "release"}) {
    EXPECT_OK(store.add_station_event(event("S1", action, "MOS2A1"))) << action;
    EXPECT_FAILS(store.add_station_event(event("S1", action, "")), ErrorCode::bad_data);
  }
  EXPECT_OK(store.add_station_event(event("S2", "sign", "")));
  EXPECT_OK(store.add_station_event(event("S2", "sign_new_baseline", "")));
  const auto unknown = store.add_station_event(event("S2", "erase", ""));
  EXPECT_FAILS(unknown, ErrorCode::usage);
  EXPECT_THAT(unknown.error().what, testing::HasSubstr("'erase'"));
  for (std::string StationEvent::*member : {&StationEvent::operator_name, &StationEvent::reason}) {
    StationEvent nameless = event("S2", "sign", "");
    nameless.*member = "";
    EXPECT_FAILS(store.add_station_event(nameless), ErrorCode::usage);
  }
  const auto actions = [&](const std::string& station) {
    std::vector<std::string> names;
    const auto events = store.station_events(station).value();
    for (const StationEvent& each : events) {
      names.push_back(each.action);
    }
    return names;
  };
  EXPECT_THAT(actions("S1"), testing::ElementsAre("check_unit", "check_unit_end", "release"));
  EXPECT_THAT(actions("S2"), testing::ElementsAre("sign", "sign_new_baseline"));
  EXPECT_EQ(actions("").size(), 5U);
}

TEST_F(StoreTest, VisitsTheRunsThatAFilterNames) {
  Store store = open();
  const auto add = [&](const std::string& kind, const std::string& serial,
                       const std::string& station, std::int64_t time_s) {
    RunRecord run = jig_run(serial);
    run.kind = kind;
    run.station = station;
    run.started = from_unix_seconds(time_s);
    ASSERT_OK(store.add_run(run, {}));
  };
  add("jig", "A", "S1", 30);
  add("jig", "A", "S2", 20);
  add("jig", "B", "S1", 10);
  add("scan", "A", "S1", 40);
  const auto started = [&](const RunFilter& filter) {
    std::vector<std::int64_t> times_s;
    EXPECT_OK(store.for_each_run(filter, [&](const RunRecord& run) {
      times_s.push_back(to_unix_seconds(run.started));
      return Status();
    }));
    return times_s;
  };
  using testing::ElementsAre;
  EXPECT_THAT(started({}), ElementsAre(10, 20, 30)) << "of jigs, by their time";
  EXPECT_THAT(started({"", "", ""}), ElementsAre(10, 20, 30, 40));
  EXPECT_THAT(started({"jig", "A", ""}), ElementsAre(20, 30));
  EXPECT_THAT(started({"jig", "", "S1"}), ElementsAre(10, 30));
  EXPECT_THAT(started({"jig", "", "", from_unix_seconds(20)}), ElementsAre(20, 30));
  EXPECT_THAT(started({"jig", "", "", {}, from_unix_seconds(20)}), ElementsAre(10));
  EXPECT_THAT(started({"jig", "A", "S2", from_unix_seconds(0), from_unix_seconds(99)}),
              ElementsAre(20));
  EXPECT_FAILS(
      store.for_each_run(
          {}, [](const RunRecord&) -> Status { return fail(ErrorCode::io, "stop", {}, "none"); }),
      ErrorCode::io);
}

TEST_F(StoreTest, AFileThatNoRepairMadeHasNoRepair) {
  Store store = open();
  const auto none = store.repair_of_output(std::string(64, '0'));
  ASSERT_OK(none);
  EXPECT_FALSE(none->has_value());
}

}  // namespace
}  // namespace sixpoint::db
