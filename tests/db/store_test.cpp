#include "db/store.h"

#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sqlite3.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "temporary_folder.h"

namespace sixpoint::db {
namespace {

using tests::TemporaryFolder;

ConstantsRecord constants(const std::string& serial, const std::string& filter, std::int64_t time_s,
                          const std::string& document = "{}") {
  ConstantsRecord record;
  record.made_at = from_unix_seconds(time_s);
  record.serial = serial;
  record.filter = filter;
  record.method = "jig";
  record.document = document;
  return record;
}

class StoreTest : public testing::Test {
 protected:
  Store open() {
    auto store = Store::open(memory_.env, path());
    if (!store) {
      throw std::runtime_error(store.error().brief());
    }
    return *std::move(store);
  }
  std::string path() const { return folder_ / "store.db"; }

  // Another program's hand in the file: triggers off, then the statement.
  void tamper(const std::string& sql) {
    sqlite3* handle = nullptr;
    ASSERT_EQ(sqlite3_open(path().c_str(), &handle), SQLITE_OK);
    std::string all = "PRAGMA foreign_keys=OFF;";
    for (const char* table : {"units", "constants", "attachments"}) {
      for (const char* change : {"update", "delete"}) {
        all += std::string("DROP TRIGGER ") + table + "_no_" + change + ";";
      }
    }
    char* message = nullptr;
    EXPECT_EQ(sqlite3_exec(handle, (all + sql).c_str(), nullptr, nullptr, &message), SQLITE_OK)
        << message;
    sqlite3_close(handle);
  }

  TemporaryFolder folder_;
  MemoryEnv memory_;
};

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
  const auto found = store.constants_for("MOS2A1", "current");
  ASSERT_OK(found);
  ASSERT_TRUE(found->has_value());
  EXPECT_EQ((*found)->document, R"({"n":3})");
  EXPECT_EQ((*found)->made_at, from_unix_seconds(300));
  EXPECT_EQ(store.constants_for("MOS2A1", "legacy").value()->document, R"({"n":2})");
  EXPECT_FALSE(store.constants_for("MOS2A2", "legacy")->has_value());
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
  EXPECT_EQ(store.constants_for("MOS2A1", "current").value()->document, "1");
  EXPECT_EQ(store.history("MOS2A1")->size(), 2U);
  EXPECT_FAILS(store.withdraw_constants("nonsense", "Ada", "x"), ErrorCode::no_input);
}

TEST_F(StoreTest, RunsKeepTheirCaptures) {
  Store store = open();
  RunRecord run;
  run.serial = "MOS2A1";
  run.kind = "jig";
  run.filter = "current";
  run.document = "{}";
  const auto id = store.add_run(run, {{"raw", Bytes{1, 2, 3}}, {"again", Bytes{1, 2, 3}}});
  ASSERT_OK(id);
  auto with_run = constants("MOS2A1", "current", 5);
  with_run.run_id = id.value();
  ASSERT_OK(store.add_constants(with_run, "w"));
  EXPECT_EQ(store.history("MOS2A1")->front().run_id, id.value());
  const auto audit = store.audit();
  ASSERT_OK(audit);
  EXPECT_TRUE(audit->ok) << audit->brief();
  EXPECT_EQ(audit->rows, 5) << "unit, run, two captures, constants";
}

TEST_F(StoreTest, AuditFindsWhatWasTouched) {
  const auto fill = [&] {
    Store store = open();
    for (int i = 0; i < 5; ++i) {
      ASSERT_OK(store.add_constants(constants("MOS2A1", "current", i), "w"));
    }
    RunRecord run;
    run.serial = "MOS2A1";
    run.kind = "jig";
    run.filter = "current";
    run.document = "{}";
    ASSERT_OK(store.add_run(run, {{"raw", Bytes{1, 2, 3}}}));
    const auto audit = store.audit();
    EXPECT_TRUE(audit->ok);
    EXPECT_EQ(audit->head.size(), 64U);
  };
  for (const char* change :
       {"UPDATE constants SET document = '{\"a\":1}' WHERE seq = 3",
        "UPDATE constants SET made_at_ns = 7 WHERE seq = 4", "DELETE FROM constants WHERE seq = 3",
        "DELETE FROM constants WHERE seq = 6",
        "UPDATE constants SET seq = 100 WHERE seq = 2; UPDATE constants SET seq = 2 WHERE seq = 3; "
        "UPDATE constants SET seq = 3 WHERE seq = 100",
        "UPDATE units SET serial = 'X' WHERE seq = 1", "UPDATE attachments SET bytes = x'00'",
        "UPDATE head SET rows = 3", "UPDATE constants SET filter = 'legacy' WHERE seq = 2"}) {
    std::filesystem::remove(path());
    fill();
    tamper(change);
    const auto audit = open().audit();
    ASSERT_OK(audit);
    EXPECT_FALSE(audit->ok) << change;
    EXPECT_FALSE(audit->findings.empty());
  }
}

TEST_F(StoreTest, TheDatabaseItselfRefusesToChangeHistory) {
  {
    Store store = open();
    ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 100), "w"));
  }
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(path().c_str(), &handle), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(handle, "UPDATE constants SET serial='X'", nullptr, nullptr, nullptr),
            SQLITE_CONSTRAINT);
  EXPECT_EQ(sqlite3_exec(handle, "DELETE FROM constants", nullptr, nullptr, nullptr),
            SQLITE_CONSTRAINT);
  sqlite3_close(handle);
}

TEST_F(StoreTest, RefusesWhatItCannotKeep) {
  Store store = open();
  EXPECT_FAILS(store.add_constants(constants("", "current", 1), "w"), ErrorCode::bad_data);
  EXPECT_FAILS(store.add_constants(constants("a\nb", "current", 1), "w"), ErrorCode::bad_data);
  EXPECT_FAILS(store.add_constants(constants(std::string(10'000, 'a'), "current", 1), "w"),
               ErrorCode::bad_data);
  EXPECT_FAILS(store.add_constants(constants("MOS", "new", 1), "w"), ErrorCode::bad_data);
  EXPECT_FAILS(store.add_constants(constants("MOS", "current", 1, "{"), "w"), ErrorCode::bad_data);
  ASSERT_OK(store.add_constants(constants("O'Hara\"; DROP TABLE units;--", "current", 1), "w"));
  EXPECT_EQ(store.units()->front().serial, "O'Hara\"; DROP TABLE units;--");
}

TEST_F(StoreTest, OpensOnlyStores) {
  std::ofstream(path()) << "this is a text file, long enough to be looked at as a database header "
                           "of one hundred bytes and more";
  EXPECT_FAILS(Store::open(memory_.env, path()), ErrorCode::bad_data);
  EXPECT_FAILS(Store::open(memory_.env, folder_ / "none/store.db"), ErrorCode::cannot_create);
  const std::string other = folder_ / "other.db";
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(other.c_str(), &handle), SQLITE_OK);
  sqlite3_exec(handle, "CREATE TABLE mine (a)", nullptr, nullptr, nullptr);
  sqlite3_close(handle);
  EXPECT_FAILS(Store::open(memory_.env, other), ErrorCode::bad_data);
  ASSERT_OK(open_sqlite(folder_ / "newer.db").value()->set_schema_version(99));
  EXPECT_FAILS(Store::open(memory_.env, folder_ / "newer.db"), ErrorCode::configuration);
}

TEST_F(StoreTest, ManyWritersLoseNothing) {
  { open(); }
  constexpr int kWriters = 4;
  constexpr int kRows = 25;
  std::vector<std::thread> writers;
  std::vector<std::string> failures(kWriters);
  for (int writer = 0; writer < kWriters; ++writer) {
    writers.emplace_back([&, writer] {
      MemoryEnv env;
      auto store = Store::open(env.env, path());
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
  EXPECT_EQ(audit->rows, kWriters * (kRows + 1));
}

}  // namespace
}  // namespace sixpoint::db
