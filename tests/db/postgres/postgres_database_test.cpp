// What only a store on a server can meet: wrong passwords, servers that are away or vanish.
#include <algorithm>
#include <array>
#include <atomic>
#include <regex>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "base/random.h"
#include "db/exchange.h"
#include "db/postgres_server.h"
#include "db/save.h"
#include "db/schema.h"
#include "db/store.h"
#include "db/store_fixture.h"
#include "expect_result.h"

namespace sixpoint::db {
namespace {

using testing::HasSubstr;
using testing::Not;
using tests::server;

ConstantsRecord constants(int number) { return db::constants("MOS2A1", "current", number); }

class PostgresStoreTest : public StoreTest {};

TEST_F(PostgresStoreTest, SaysWhatIsWrongAndNeverThePassword) {
  const auto refused = [&](const std::string& where, ErrorCode code) {
    const auto store = Store::open(memory_.env, where);
    EXPECT_FAILS(store, code);
    if (!store) {
      EXPECT_THAT(store.error().brief(), Not(HasSubstr("s3cret"))) << where;
      EXPECT_THAT(store.error().brief(), Not(HasSubstr("%2Fp"))) << where;
      EXPECT_THAT(store.error().brief(), Not(HasSubstr("pw@"))) << where;
    }
  };
  location();
  refused(server().location("store_none"), ErrorCode::no_input);
  refused(server().location("postgres", "s3cret wrong"), ErrorCode::permission);
  refused("postgresql://station:s3cret@127.0.0.1:1/x", ErrorCode::device_unavailable);
  refused("postgresql://station:s3cret@/pw@127.0.0.1:port/x", ErrorCode::usage);
  refused("postgresql://station:s3cret%zz@127.0.0.1/x", ErrorCode::usage);
  refused("postgresql://127.0.0.1:1/x?password=s3cret&nonsense=1", ErrorCode::usage);
  auto database = open_postgres(location());
  ASSERT_OK(database);
  EXPECT_THAT((*database)->location(), Not(HasSubstr("s3cret")));
}

TEST_F(PostgresStoreTest, SaysWhichUserOrDatabaseTheServerDoesNotTake) {
  const auto with = [&](const std::string& name, const std::string& password) {
    std::string where = server().location("postgres", password);
    return where.replace(where.find("station:"), 7, name);
  };
  location();
  const std::string closed = place_->location("closed");
  place_->tamper("main", "ALTER DATABASE " + closed.substr(closed.rfind('/') + 1) +
                             " ALLOW_CONNECTIONS false");
  place_->tamper("main", "CREATE ROLE guest NOLOGIN PASSWORD 'guests'");
  std::string by_socket = server().superuser("postgres");
  by_socket.replace(by_socket.find("user=postgres"), 13, "user=nobody");
  const struct {
    std::string where;
    ErrorCode code;
    const char* what;
  } cases[] = {
      {with("station", ""), ErrorCode::permission, "no password"},
      {with("guest", "guests"), ErrorCode::permission, "not permitted to log in"},
      {by_socket, ErrorCode::permission, "pg_hba.conf"},
      {closed, ErrorCode::device_unavailable, "not currently accepting connections"},
      // The server's words hold the password, which is the user's name here.
      {with("station", "station"), ErrorCode::permission, "for user \"***\""},
  };
  for (const auto& each : cases) {
    SCOPED_TRACE(each.what);
    const auto database = open_postgres(each.where);
    EXPECT_FAILS(database, each.code);
    EXPECT_THAT(database.error().what, HasSubstr(each.what));
    EXPECT_THAT(database.error().where, testing::StartsWith("postgresql://"));
  }
  place_->tamper("main", "DROP ROLE guest");
}

TEST_F(PostgresStoreTest, ADatabaseThatKeepsTextsOtherwiseIsNoPlaceForAStore) {
  location();
  ASSERT_TRUE(place_->statements(
      "main", "CREATE DATABASE other_texts ENCODING 'SQL_ASCII' TEMPLATE template0"));
  const auto refused = Store::open(memory_.env, server().location("other_texts"));
  EXPECT_FAILS(refused, ErrorCode::configuration);
  EXPECT_THAT(refused.error().what, HasSubstr("SQL_ASCII"));
  EXPECT_THAT(refused.error().hint, HasSubstr("UTF8"));
  EXPECT_TRUE(place_->statements("main", "DROP DATABASE other_texts"));
}

TEST_F(PostgresStoreTest, SaysWhatEachOfTheServersErrorsMeans) {
  // Appendix A of PostgreSQL's manual has the states.
  const struct {
    const char* state;
    ErrorCode code;
    const char* hint;
  } cases[] = {
      {"08006", ErrorCode::device_unavailable, "check that the server runs"},
      {"22003", ErrorCode::bad_data, "cannot be stored as it is"},
      {"23505", ErrorCode::bad_data, "write a correction"},
      {"25006", ErrorCode::permission, "the server's administrator"},
      {"28000", ErrorCode::permission, "the server's administrator"},
      {"40001", ErrorCode::io, "another program keeps the store busy"},
      {"40P01", ErrorCode::io, "another program keeps the store busy"},
      {"42501", ErrorCode::permission, "the server's administrator"},
      {"42P01", ErrorCode::internal, "please report this"},
      {"53100", ErrorCode::io, "free some space"},
      {"53200", ErrorCode::io, "free some space"},
      {"53300", ErrorCode::device_unavailable, "check that the server runs"},
      {"55P03", ErrorCode::io, "another program keeps the store busy"},
      {"57P03", ErrorCode::device_unavailable, "check that the server runs"},
      {"P0001", ErrorCode::bad_data, "write a correction"},
      {"XX001", ErrorCode::bad_data, "restore the last backup"},
  };
  auto store = Store::open(memory_.env, location());
  ASSERT_OK(store);
  for (const auto& each : cases) {
    SCOPED_TRACE(each.state);
    const auto answer = store->database().execute(
        std::string("DO $$ BEGIN RAISE EXCEPTION 'the server says' USING ERRCODE = '") +
        each.state + "'; END $$");
    EXPECT_FAILS(answer, each.code);
    EXPECT_THAT(answer.error().what, HasSubstr("the server says"));
    EXPECT_EQ(answer.error().where, store->database().location());
    EXPECT_THAT(answer.error().hint, HasSubstr(each.hint));
    EXPECT_OK(store->head()) << "the same connection goes on";
  }
}

TEST_F(PostgresStoreTest, ATextWithAZeroByteIsRefusedAndNotCutOff) {
  auto store = Store::open(memory_.env, location());
  ASSERT_OK(store);
  const auto refused = store->database().execute("INSERT INTO attachments VALUES ($1, '')",
                                                 std::vector<Value>{std::string("a\0b", 3)});
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_THAT(refused.error().what, HasSubstr("zero byte"));
  EXPECT_TRUE(store->database().query("SELECT sha256 FROM attachments")->empty());
}

TEST_F(PostgresStoreTest, AWriterThatWaitsInVainForAnotherSaysSo) {
  auto writing = Store::open(memory_.env, location());
  auto waiting = Store::open(memory_.env, location());
  ASSERT_OK(waiting);
  ASSERT_OK(writing->database().begin_writing());
  ASSERT_OK(waiting->database().execute("SET lock_timeout = '1ms'"));
  const auto refused = waiting->add_constants(constants(1), "w");
  EXPECT_FAILS(refused, ErrorCode::io);
  EXPECT_THAT(refused.error().hint, HasSubstr("another program keeps the store busy"));
  writing->database().roll_back();
  EXPECT_OK(waiting->add_constants(constants(1), "w")) << "the same store goes on";
}

TEST_F(PostgresStoreTest, AConnectionThatTheServerEndsIsMadeAnew) {
  auto store = Store::open(memory_.env, location());
  ASSERT_OK(store);
  const auto end_connections = [&] {
    place_->tamper("main",
                   "SELECT pg_terminate_backend(pid, 60000) FROM pg_stat_activity WHERE usename = "
                   "'station' AND datname = current_database()");
  };
  end_connections();
  EXPECT_OK(store->add_constants(constants(1), "w"));
  end_connections();
  EXPECT_EQ(store->history("MOS2A1").value().size(), 1U);
  // Within a transaction, what went before is lost: it is an error.
  ASSERT_OK(store->database().begin_writing());
  end_connections();
  EXPECT_FAILS(store->database().query("SELECT 1"), ErrorCode::device_unavailable);
  store->database().roll_back();
  EXPECT_OK(store->add_constants(constants(2), "w"));
  EXPECT_EQ(store->history("MOS2A1").value().size(), 2U);
}

TEST_F(PostgresStoreTest, WhereTheServerVanishesAtTheCommitItSaysThatTheRowMayBeThere) {
  auto store = Store::open(memory_.env, location());
  ASSERT_OK(store);
  Database& database = store->database();
  ASSERT_OK(database.begin_writing());
  server().kill();
  const auto status = database.commit();
  EXPECT_FAILS(status, ErrorCode::device_unavailable);
  EXPECT_THAT(status.error().what, HasSubstr("whether it did is not known"));
  EXPECT_THAT(status.error().hint, HasSubstr("run the command again"));
  database.roll_back();
  // Every later call says it too, until the server is there again.
  EXPECT_FAILS(database.execute("SELECT 1"), ErrorCode::device_unavailable);
  EXPECT_FAILS(database.query("SELECT 1"), ErrorCode::device_unavailable);
  EXPECT_FAILS(database.begin_reading(), ErrorCode::device_unavailable);
  server().start();
  EXPECT_OK(database.query("SELECT 1"));
  EXPECT_OK(store->add_constants(constants(1), "w"));
}

TEST_F(PostgresStoreTest, OpensOnlyStores) {
  const std::string foreign = place_->location("foreign");
  ASSERT_TRUE(place_->statements("foreign", "CREATE TABLE mine (a int)"));
  EXPECT_FAILS(Store::open(memory_.env, foreign), ErrorCode::bad_data);
  const std::string newer = place_->location("newer");
  { ASSERT_OK(Store::open(memory_.env, newer)); }
  ASSERT_TRUE(place_->statements("newer", "UPDATE sixpoint_schema SET version = 99"));
  EXPECT_FAILS(Store::open(memory_.env, newer), ErrorCode::configuration);
}

TEST_F(PostgresStoreTest, AQuestionMakesNoStore) {
  const std::string empty = place_->location("empty");
  const auto asked = Store::open_existing(memory_.env, empty);
  EXPECT_FAILS(asked, ErrorCode::no_input);
  auto database = open_postgres(empty);
  ASSERT_OK(database);
  EXPECT_EQ((*database)->schema_version().value(), 0);
  { ASSERT_OK(Store::open(memory_.env, empty)); }
  EXPECT_OK(Store::open_existing(memory_.env, empty));
}

// Where "aa" stands behind "z". Oracle: the order of the server, asked here.
TEST_F(PostgresStoreTest, AnIdIsFoundByItsBeginningInEveryOrderOfLetters) {
  location();
  ASSERT_TRUE(place_->statements(
      "main",
      "CREATE DATABASE danish TEMPLATE template0 ENCODING 'UTF8' LOCALE_PROVIDER icu ICU_LOCALE "
      "'da-DK'"));
  const std::string danish = server().location("danish");
  {
    auto store = Store::open(memory_.env, danish);
    ASSERT_OK(store);
    const auto order = store->database().query("SELECT 1 WHERE 'aa' > 'z'", {});
    ASSERT_OK(order);
    ASSERT_EQ(order->size(), 1U) << "the database has another order";
    int found = 0;
    for (int number = 0; number < 400; ++number) {
      const auto id = store->add_constants(constants(number), "w");
      ASSERT_OK(id);
      if (id->substr(7, 2) == "aa" || id->substr(8, 2) == "aa") {
        EXPECT_EQ(store->whole_key("constants", id->substr(0, 9)).value(), *id);
        ++found;
      }
    }
    EXPECT_GT(found, 0) << "no id has it at the cut";
  }
  EXPECT_TRUE(place_->statements("main", "DROP DATABASE danish"));
}

TEST_F(PostgresStoreTest, ARefusalByRightsIsNamedSo) {
  { ASSERT_OK(Store::open(memory_.env, location())); }
  place_->tamper("main", "REVOKE INSERT ON units FROM station");
  auto store = Store::open(memory_.env, location());
  ASSERT_OK(store);
  EXPECT_FAILS(store->add_constants(constants(1), "w"), ErrorCode::permission);
  place_->tamper("main", "GRANT INSERT ON units TO station");
  EXPECT_OK(store->add_constants(constants(1), "w"));
}

TEST_F(PostgresStoreTest, AServerThatVanishesInMidTransactionLosesOnlyThatTransaction) {
  auto store = Store::open(memory_.env, location());
  ASSERT_OK(store);
  ASSERT_OK(store->add_constants(constants(1), "w"));
  Database& database = store->database();
  ASSERT_OK(database.begin_writing());
  ASSERT_OK(database.execute("INSERT INTO attachments VALUES ('x', '')"));
  server().kill();
  const auto status = database.execute("INSERT INTO attachments VALUES ('y', '')");
  EXPECT_FAILS(status, ErrorCode::device_unavailable);
  EXPECT_THAT(status.error().brief(), Not(HasSubstr("s3cret")));
  database.roll_back();
  EXPECT_FAILS(store->add_constants(constants(2), "w"), ErrorCode::device_unavailable);
  server().start();
  EXPECT_OK(store->add_constants(constants(2), "w")) << "the same store goes on";
  EXPECT_EQ(store->history("MOS2A1")->size(), 2U);
  const auto audit = store->audit();
  EXPECT_TRUE(audit->ok) << audit->brief();
}

// The tables of an early version are those of its SQLite text with the other server's types, the
// rows and hashes the same. (No program ever wrote version 1 on PostgreSQL.)
std::string for_postgres(std::string sql, int version) {
  const auto replace = [&](const char* pattern, const char* with) {
    sql = std::regex_replace(sql, std::regex(pattern), with);
  };
  replace("PRAGMA[^;]*;", "");
  replace("CREATE TRIGGER[^;]*;\\s*END;", "");
  replace("\\)\\s+STRICT", ")");
  replace("INTEGER", "BIGINT");
  replace("BLOB", "BYTEA");
  replace("x'([0-9a-f]*)'", "'\\x$1'");
  return sql +
         "CREATE TABLE sixpoint_schema (one BIGINT PRIMARY KEY CHECK (one = 1), version BIGINT NOT "
         "NULL); INSERT INTO sixpoint_schema VALUES (1, " +
         std::to_string(version) + ");";
}

TEST_F(PostgresStoreTest, BringsStoresOfEveryVersionUpToDateAndTheirHashesHold) {
  // The heads are those that Python's hashlib computed for the SQLite stores.
  const struct {
    const char* sql;
    const char* head;
    const char* filter;
  } versions[] = {
      {
#include "db/store_version_1.sql.inc"
          , "74f4943fa1dd97ddebe9c81a3d40776ef9b0ee4af156aa10d9e7766429e3d57d", "legacy"},
      {
#include "db/store_version_2.sql.inc"
          , "b88f65e21c3f51132480dc74ef7f68d9c281037c02b63880f9e4a018855351dd", "current"}};
  int version = 0;
  for (const auto& early : versions) {
    ++version;
    SCOPED_TRACE(version);
    const std::string name = "version_" + std::to_string(version);
    const std::string where = place_->location(name);
    ASSERT_TRUE(place_->statements(name, for_postgres(early.sql, version)));
    auto store = Store::open(memory_.env, where);
    ASSERT_OK(store);
    const auto audit = store->audit();
    ASSERT_OK(audit);
    EXPECT_TRUE(audit->ok) << audit->brief();
    EXPECT_EQ(audit->head, early.head);
    EXPECT_FALSE(store->constants_history("MOS2A1")->constants.empty());
    EXPECT_EQ(store->unit_history("MOS2A1")->runs.size(), 1U);
    ASSERT_OK(store->add_constants(constants(7), "w"));
    EXPECT_TRUE(store->audit()->ok);
    EXPECT_EQ(store->database().schema_version().value(), kSchemaVersion);
  }
  EXPECT_EQ(version, kSchemaVersion - 1) << "every earlier version has its text";
}

TEST_F(PostgresStoreTest, AFullDiskLosesNothingThatWasAcknowledged) {
  auto store = Store::open(memory_.env, location());
  ASSERT_OK(store);
  Random random(3);
  const auto add_run = [&](int number) {
    RunRecord run;
    run.serial = "MOS2A1";
    run.filter = "current";
    run.started = from_unix_seconds(number);
    run.document = "{}";
    Bytes capture(300'000);  // that no server packs
    std::generate(capture.begin(), capture.end(),
                  [&] { return static_cast<std::uint8_t>(random.below(256)); });
    return store->add_run(run, {{"raw", capture}});
  };
  ASSERT_OK(add_run(1));
  server().fill_disk(true);
  const auto refused = add_run(2);
  server().fill_disk(false);
  EXPECT_FAILS(refused, ErrorCode::io);
  EXPECT_THAT(refused.error().brief(), HasSubstr("No space left"));
  EXPECT_EQ(store->unit_history("MOS2A1")->runs.size(), 1U);
  ASSERT_OK(add_run(3)) << "the same store goes on";
  EXPECT_EQ(store->unit_history("MOS2A1")->runs.size(), 2U);
  const auto audit = store->audit();
  ASSERT_OK(audit);
  EXPECT_TRUE(audit->ok) << audit->brief();
}

TEST_F(PostgresStoreTest, AWrongPasswordOrAServerThatIsAwayLosesNoRun) {
  auto direct = Store::open(memory_.env, location());
  ASSERT_OK(direct);
  const SavePlaces places{"journal", {}};
  int number = 0;
  const auto keep_one = [&](Result<Store> store) {
    return save(memory_.files, store, places, [&](RecordWriter& writer) -> Status {
      SIXPOINT_CHECK(writer.add_constants(constants(++number), "w"));
      return {};
    });
  };
  std::string wrong = location();
  wrong.replace(wrong.find("s3cret"), 6, "public");
  const auto first = keep_one(Store::open(memory_.env, wrong));
  ASSERT_OK(first);
  EXPECT_EQ(first->refusal->code, ErrorCode::permission);
  EXPECT_THAT(first->refusal->brief(), Not(HasSubstr("public/")));
  // Open when the server vanishes.
  auto open_store = Store::open(memory_.env, location());
  server().kill();
  const auto second = keep_one(std::move(open_store));
  server().start();
  ASSERT_OK(second);
  EXPECT_EQ(second->refusal->code, ErrorCode::device_unavailable);
  const auto third = keep_one(Store::open(memory_.env, location()));
  ASSERT_OK(third);
  EXPECT_TRUE(third->in_store());
  EXPECT_EQ(third->caught_up, 2U);
  const auto history = direct->history("MOS2A1");
  ASSERT_OK(history);
  ASSERT_EQ(history->size(), 3U);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ((*history)[static_cast<std::size_t>(i)].made_at, from_unix_seconds(i + 1));
  }
}

// Killed like in a power cut while several stations write: what was acknowledged is there.
// SIXPOINT_SERVER_KILLS sets how often.
TEST_F(PostgresStoreTest, KilledAtRandomMomentsItKeepsEveryAcknowledgedRow) {
  { ASSERT_OK(Store::open(memory_.env, location())); }
  const char* wanted = std::getenv("SIXPOINT_SERVER_KILLS");
  const int kills = wanted == nullptr ? 5 : std::atoi(wanted);
  constexpr int kWriters = 3;
  Random random(9);
  std::array<std::vector<int>, kWriters> acknowledged;
  std::array<int, kWriters> next{};
  for (int kill = 0; kill < kills; ++kill) {
    std::atomic<int> open_writers = 0;
    std::vector<std::thread> writers;
    for (int writer = 0; writer < kWriters; ++writer) {
      writers.emplace_back([&, writer] {
        const auto w = static_cast<std::size_t>(writer);
        MemoryEnv env;
        auto store = Store::open(env.env, place_->location("main"));
        ++open_writers;
        while (store) {
          const int number = 1'000'000 * writer + next[w]++;
          if (!store->add_constants(constants(number), "w")) {
            break;
          }
          acknowledged[w].push_back(number);
        }
      });
    }
    while (open_writers < kWriters) {
      std::this_thread::yield();
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(random.below(60)));
    server().kill();
    for (std::thread& writer : writers) {
      writer.join();
    }
    server().start();
    auto store = Store::open(memory_.env, location());
    ASSERT_OK(store);
    const auto audit = store->audit();
    ASSERT_OK(audit);
    ASSERT_TRUE(audit->ok) << audit->brief();
    const auto history = store->history("MOS2A1");
    std::set<std::int64_t> stored;
    for (const auto& record : *history) {
      EXPECT_TRUE(stored.insert(to_unix_seconds(record.made_at)).second) << "doubled";
    }
    for (const auto& numbers : acknowledged) {
      for (const int number : numbers) {
        ASSERT_TRUE(stored.contains(number)) << number << " was acknowledged before kill " << kill;
      }
    }
  }
  EXPECT_GT(acknowledged[0].size() + acknowledged[1].size() + acknowledged[2].size(),
            static_cast<std::size_t>(kills));
}

TEST_F(PostgresStoreTest, MovesToAFileAndBackWithTheSameHead) {
  sixpoint::tests::TemporaryFolder folder;
  auto on_server = Store::open(memory_.env, location());
  ASSERT_OK(on_server);
  for (int i = 0; i < 2500; ++i) {
    ASSERT_OK(on_server->add_constants(constants(i), "w"));
  }
  RunRecord run;
  run.serial = "Zoë";
  run.filter = "legacy";
  run.document = R"({"text":"\u0000 ü"})";
  ASSERT_OK(on_server->add_run(run, {{"raw", Bytes{0, 255}}}));
  const auto head = on_server->audit()->head;
  ASSERT_OK(export_json_lines(*on_server, memory_.files, "a.jsonl"));
  auto in_file = Store::open(memory_.env, folder / "store.db");
  ASSERT_OK(import_json_lines(*in_file, memory_.files, "a.jsonl"));
  EXPECT_EQ(in_file->audit()->head, head);
  ASSERT_OK(export_json_lines(*in_file, memory_.files, "b.jsonl"));
  auto back = Store::open(memory_.env, place_->location("back"));
  ASSERT_OK(import_json_lines(*back, memory_.files, "b.jsonl"));
  EXPECT_EQ(back->audit()->head, head);
  EXPECT_EQ(*read_file(memory_.files, "a.jsonl"), *read_file(memory_.files, "b.jsonl"));
}

}  // namespace
}  // namespace sixpoint::db
