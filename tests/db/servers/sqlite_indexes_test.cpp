#include "db/servers/sqlite_indexes.h"

#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

namespace sixpoint::db {
namespace {

using testing::HasSubstr;

class SqliteIndexes : public testing::Test {
 protected:
  void run(const std::string& sql) {
    char* message = nullptr;
    ASSERT_EQ(sqlite3_exec(handle_.get(), sql.c_str(), nullptr, nullptr, &message), SQLITE_OK)
        << message;
  }
  // Changes rows behind the back of the index `name`.
  void run_without_index(const std::string& name, const std::string& sql) {
    run("CREATE TABLE aside AS SELECT * FROM sqlite_schema WHERE name = '" + name +
        "'; PRAGMA writable_schema = ON; DELETE FROM sqlite_schema WHERE name = '" + name +
        "'; PRAGMA writable_schema = RESET");
    run(sql);
    run("PRAGMA writable_schema = ON; INSERT INTO sqlite_schema SELECT * FROM aside; "
        "PRAGMA writable_schema = RESET; DROP TABLE aside");
  }
  std::vector<std::string> check() { return check_sqlite_indexes(*handle_); }

 private:
  static sqlite3* open_in_memory() {
    sqlite3* handle = nullptr;
    sqlite3_open(":memory:", &handle);
    return handle;
  }
  std::unique_ptr<sqlite3, int (*)(sqlite3*)> handle_{open_in_memory(), sqlite3_close};
};

TEST_F(SqliteIndexes, ValuesOfEveryKindStandInTheirOrder) {
  run(R"(CREATE TABLE "a ""b""" (k, n); CREATE INDEX by_both ON "a ""b""" (k, n))");
  run(R"(INSERT INTO "a ""b""" VALUES (NULL, 1), (NULL, NULL), (-5, 1), (0, -9223372036854775808),)"
      R"( (7, 9223372036854775807), ('', 1), ('a', 1), ('ab', 0), (CAST(x'6100' AS TEXT), 1),)"
      R"( (CAST(x'610001' AS TEXT), 1), (CAST(x'6101' AS TEXT), 1), ('b', NULL))");
  EXPECT_THAT(check(), testing::IsEmpty());
}

TEST_F(SqliteIndexes, AnEntryOfAnotherRowIsFound) {
  run("CREATE TABLE t (k); CREATE INDEX by_k ON t (k); INSERT INTO t VALUES ('a'), ('b')");
  run_without_index("by_k", "UPDATE t SET k = CAST(x'6200' AS TEXT) WHERE k = 'b'");
  EXPECT_THAT(check(), testing::ElementsAre(HasSubstr("the index by_k of t does not say")));
}

TEST_F(SqliteIndexes, OfManyIndexesTheFirst20AreNamed) {
  run("CREATE TABLE t (k); INSERT INTO t VALUES ('a')");
  for (int i = 10; i < 35; ++i) {
    const std::string name = "by_" + std::to_string(i);
    run("CREATE INDEX " + name + " ON t (k)");
  }
  run("CREATE TABLE aside AS SELECT * FROM sqlite_schema WHERE type = 'index'; "
      "PRAGMA writable_schema = ON; DELETE FROM sqlite_schema WHERE type = 'index'; "
      "PRAGMA writable_schema = RESET; UPDATE t SET k = 'b'");
  run("PRAGMA writable_schema = ON; INSERT INTO sqlite_schema SELECT * FROM aside; "
      "PRAGMA writable_schema = RESET; DROP TABLE aside");
  const auto findings = check();
  ASSERT_EQ(findings.size(), 20U);
  EXPECT_THAT(findings.front(), HasSubstr("by_10 of t"));
  EXPECT_THAT(findings.back(), HasSubstr("by_29 of t"));
}

}  // namespace
}  // namespace sixpoint::db
