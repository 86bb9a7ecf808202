// Whatever call of the server fails: the operation says so, nothing of it stays, and it succeeds
// when it is tried again.
#include "failing_database.h"

#include "base/atomic_file.h"
#include "db/exchange.h"
#include "db/journal.h"
#include "store_fixture.h"
#include "temporary_folder.h"

namespace sixpoint::db {
namespace {

using tests::FailingDatabase;

constexpr const char* kSerial = "MOS2A45130007";

RunRecord run_of_jig() {
  RunRecord run = jig_run(kSerial);
  run.jig = "J1";
  run.verdict = "pass";
  run.document = R"({"jig":"J1","verdict":"pass"})";
  run.started = from_unix_seconds(1'000);
  run.ended = from_unix_seconds(1'100);
  return run;
}

RepairRecord repair_with(const std::string& constants_id) {
  RepairRecord repair;
  repair.serial = kSerial;
  repair.made_at = from_unix_seconds(3'000);
  repair.input = "a.gt3x";
  repair.input_sha256 = std::string(64, 'a');
  repair.output_sha256 = std::string(64, 'b');
  repair.method = "store";
  repair.constants_id = constants_id;
  repair.document = "{}";
  return repair;
}

StationEvent check_unit_event() {
  StationEvent event;
  event.station = "S1";
  event.serial = kSerial;
  event.action = "check_unit";
  event.operator_name = "Ada";
  event.reason = "new";
  return event;
}

// A store with a little of everything, whose server fails when it is told to.
class FailingDatabaseTest : public testing::Test {
 protected:
  FailingDatabaseTest() {
    auto database = std::make_unique<FailingDatabase>();
    server_ = database.get();
    store_.emplace(Store::in(memory_.env, std::move(database)).value());
    run_id_ = store_->add_run(run_of_jig(), {{"samples", Bytes{1, 2, 3}}}).value();
    const auto record = constants(kSerial, "current", 2'000);
    constants_id_ = store_->add_constants(record, "wGT3X-BT").value();
    withdrawn_id_ = store_->add_constants(constants(kSerial, "legacy", 2'001), "wGT3X-BT").value();
    EXPECT_OK(store_->withdraw_constants(withdrawn_id_, "Ada", "wrong jig"));
    EXPECT_OK(store_->add_repair(repair_with(withdrawn_id_)));
    EXPECT_OK(store_->add_station_event(check_unit_event()));
  }

  // Lets the first call fail, then the second ..., until there is none left to fail.
  template <class Operation>
  void each_call_fails(const char* name, Operation operation) {
    SCOPED_TRACE(name);
    std::size_t failures = 0;
    for (;; ++failures) {
      const StoreHead before = store_->head().value();
      server_->fail_at(failures);
      const auto result = operation();
      server_->stop_failing();
      if (!server_->has_failed()) {
        EXPECT_OK(result);
        break;
      }
      ASSERT_FALSE(result.has_value()) << "call " << failures << " failed, and nothing was said";
      EXPECT_EQ(result.error().code, ErrorCode::io) << result.error().brief();
      ASSERT_EQ(store_->head().value().head, before.head) << "call " << failures;
    }
    EXPECT_GT(failures, 0U);
    EXPECT_TRUE(store_->audit().value().ok);
  }

  MemoryEnv memory_;
  FailingDatabase* server_ = nullptr;
  std::optional<Store> store_;
  std::string run_id_;
  std::string constants_id_;
  std::string withdrawn_id_;
};

TEST_F(FailingDatabaseTest, NothingIsAddedByHalf) {
  each_call_fails("run", [&] {
    RunRecord run = run_of_jig();
    run.document = R"({"second":1})";
    return store_->add_run(run, {{"samples", Bytes{4}}, {"more", Bytes{5, 6}}});
  });
  each_call_fails("constants", [&] {
    return store_->add_constants(constants("MOS2A45130008", "current", 5), "wGT3X-BT");
  });
  each_call_fails("write", [&] {
    return store_->add_unit_write({run_id_, kSerial, from_unix_seconds(2'500), "[]", "[1]", "[1]"});
  });
  each_call_fails("repair", [&] { return store_->add_repair(repair_with(constants_id_)); });
  each_call_fails("event", [&] {
    StationEvent event = check_unit_event();
    event.action = "check_unit_end";
    return store_->add_station_event(event);
  });
  each_call_fails("prefer", [&] {
    return store_->correct({.table = "constants",
                            .row_id = constants_id_.substr(0, 12),
                            .action = "prefer",
                            .operator_name = "Ada",
                            .reason = "newer"});
  });
  each_call_fails("withdraw", [&] {
    return store_->withdraw_constants(constants_id_, "Ada", "unit was dropped");
  });
}

TEST_F(FailingDatabaseTest, NoQuestionIsAnsweredByHalf) {
  each_call_fails("units", [&] { return store_->units(); });
  each_call_fails("history", [&] { return store_->history(kSerial); });
  each_call_fails("unit_history", [&] { return store_->unit_history(kSerial); });
  each_call_fails("constants_history", [&] { return store_->constants_history(kSerial); });
  each_call_fails("run", [&] { return store_->run(run_id_.substr(0, 12)); });
  each_call_fails("for_each_run", [&] {
    return store_->for_each_run({}, [](const RunRecord&) { return Status(); });
  });
  each_call_fails("station_events", [&] { return store_->station_events("S1"); });
  each_call_fails("repair_of_output",
                  [&] { return store_->repair_of_output(std::string(64, 'b')); });
  each_call_fails("recall_list", [&] { return store_->recall_list(); });
  each_call_fails("recall_list of one", [&] { return store_->recall_list(withdrawn_id_); });
  each_call_fails("units_of_jig", [&] { return store_->units_of_jig("J1"); });
  each_call_fails("yield", [&] { return store_->yield({}, from_unix_seconds(9'000)); });
  each_call_fails("units_due", [&] { return store_->units_due(from_unix_seconds(9'000)); });
  each_call_fails("trend", [&] { return store_->trend(kSerial); });
  each_call_fails("head", [&] { return store_->head(); });
  each_call_fails("head_of_run", [&] { return store_->head_of_run(run_id_); });
  const std::string head = store_->head().value().head;
  each_call_fails("audit", [&] { return store_->audit(head); });
}

TEST_F(FailingDatabaseTest, AnExportIsWholeOrNotThere) {
  each_call_fails("JSON Lines", [&] {
    const auto report = export_json_lines(*store_, memory_.files, "all.jsonl");
    EXPECT_EQ(report.has_value(), memory_.files.info("all.jsonl").has_value());
    return report;
  });
  int tries = 0;
  each_call_fails("CSV", [&] {
    return export_csv(*store_, memory_.files, "tables" + std::to_string(++tries));
  });
}

TEST_F(FailingDatabaseTest, AnImportIsWholeOrNotThere) {
  ASSERT_OK(export_json_lines(*store_, memory_.files, "all.jsonl"));
  auto database = std::make_unique<FailingDatabase>();
  server_ = database.get();
  store_.emplace(Store::in(memory_.env, std::move(database)).value());
  each_call_fails("import", [&] { return import_json_lines(*store_, memory_.files, "all.jsonl"); });
  EXPECT_EQ(store_->units().value().size(), 1U);
}

TEST_F(FailingDatabaseTest, ABackupIsWholeOrNotThere) {
  const sixpoint::tests::TemporaryFolder folder;
  Env env{memory_.clock, posix_env().files};
  const std::string path = folder / "backup.db";
  each_call_fails("backup", [&] {
    const auto report = backup(*store_, env, path);
    EXPECT_EQ(report.has_value(), env.files.info(path).has_value());
    return report;
  });
  EXPECT_EQ(Store::open(env, path)->head()->head, store_->head()->head);
}

TEST_F(FailingDatabaseTest, ACopyThatGoesAwayIsNoBackup) {
  const sixpoint::tests::TemporaryFolder folder;
  Env env{memory_.clock, posix_env().files};
  server_->lose_copies();
  EXPECT_FAILS(backup(*store_, env, folder / "backup.db"), ErrorCode::io);
  EXPECT_THAT(env.files.list(folder.path()).value(), testing::IsEmpty()) << "no empty store";
}

TEST_F(FailingDatabaseTest, TheJournalKeepsWhatTheStoreDidNotTake) {
  auto journal = Journal::open(memory_.files, "journal").value();
  RunRecord run = run_of_jig();
  run.document = R"({"in":"the journal"})";
  ASSERT_OK(journal.add_run(run, {{"samples", Bytes{7}}}));
  each_call_fails("catch_up", [&] {
    const auto taken = journal.catch_up(*store_);
    EXPECT_EQ(journal.pending().value(), taken ? 0U : 1U);
    return taken;
  });
}

TEST(FailingDatabase, MakingAStoreSaysWhatFailed) {
  MemoryEnv memory;
  for (std::size_t call = 0;; ++call) {
    auto database = std::make_unique<FailingDatabase>();
    FailingDatabase& server = *database;
    server.fail_at(call);
    const auto store = Store::in(memory.env, std::move(database));
    if (store) {
      EXPECT_FALSE(server.has_failed());
      EXPECT_GT(call, 5U);
      return;
    }
    EXPECT_EQ(store.error().code, ErrorCode::io);
  }
}

}  // namespace
}  // namespace sixpoint::db
