#include "db/schema.h"

#include <algorithm>
#include <cassert>

#include <fmt/format.h>

namespace sixpoint::db {

const std::vector<Table>& tables() {
  static const std::vector<Table> kTables = {
      {"units",
       {{.name = "serial"}, {.name = "model"}, {"first_seen_ns", ColumnType::integer}},
       {}},
      {"runs",
       {{.name = "id"},
        {.name = "serial", .references = "units(serial)"},
        {.name = "kind"},  // jig, capture, scan
        {.name = "filter"},
        {"started_ns", ColumnType::integer},
        {"ended_ns", ColumnType::integer},
        {.name = "operator"},
        {.name = "station"},
        {.name = "jig"},
        {.name = "verdict"},
        {.name = "software"},
        {.name = "retest_of", .required = false, .references = "runs(id)"},
        {.name = "document"}},
       {"serial", "jig"}},
      {"captures",
       {{.name = "id"},
        {.name = "run_id", .references = "runs(id)"},
        {.name = "name"},
        {.name = "sha256", .references = "attachments(sha256)"}},
       {"run_id"}},
      {"constants",
       {{.name = "id"},
        {.name = "serial", .references = "units(serial)"},
        {.name = "filter"},
        {"made_at_ns", ColumnType::integer},
        {.name = "method"},
        {.name = "run_id", .required = false, .references = "runs(id)"},
        {.name = "document"}},
       {"serial, filter, made_at_ns"}},
      {"unit_writes",
       {{.name = "id"},
        {.name = "run_id", .references = "runs(id)"},
        {.name = "serial", .references = "units(serial)"},
        {"written_ns", ColumnType::integer},
        {.name = "as_found"},
        {.name = "as_left"},
        {.name = "read_back"}},
       {"serial"}},
      {"repairs",
       {{.name = "id"},
        {.name = "serial"},  // of the file; its unit need never have been here
        {"made_at_ns", ColumnType::integer},
        {.name = "input"},
        {.name = "input_sha256"},
        {.name = "output_sha256"},
        {.name = "method"},
        {.name = "constants_id", .required = false, .references = "constants(id)"},
        {.name = "document"}},
       {"constants_id", "input_sha256", "output_sha256", "serial"}},
      {"corrections",
       {{.name = "id"},
        {"made_at_ns", ColumnType::integer},
        {.name = "about_table"},
        {.name = "about_id"},
        {.name = "action"},  // withdraw, note
        {.name = "operator"},
        {.name = "reason"}},
       {"about_table, about_id"}},
  };
  return kTables;
}

const Table& table(std::string_view name) {
  const auto found = std::find_if(tables().begin(), tables().end(),
                                  [&](const Table& table) { return table.name == name; });
  assert(found != tables().end());
  return *found;
}

namespace {

std::string create_statement(const Table& table, const Database& database) {
  const std::string integer = database.integer_type();
  std::string sql = fmt::format("CREATE TABLE {} (seq {} PRIMARY KEY", table.name, integer);
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const Column& column = table.columns[i];
    sql += fmt::format(", {} {}{}{}", column.name,
                       column.type == ColumnType::integer ? integer : "TEXT",
                       column.required ? " NOT NULL" : "", i == 0 ? " UNIQUE" : "");
    if (!column.references.empty()) {
      sql += fmt::format(" REFERENCES {}", column.references);
    }
  }
  return sql + fmt::format(", hash {} NOT NULL){}", database.blob_type(), database.table_options());
}

Status create_version_1(Database& database) {
  const std::string blob = database.blob_type();
  const std::string options = database.table_options();
  const std::string integer = database.integer_type();
  // One row: how many rows the history has and the hash of the last one. The only row that changes.
  SIXPOINT_CHECK(
      database.execute(fmt::format("CREATE TABLE head (one {} PRIMARY KEY CHECK (one = 1), rows {} "
                                   "NOT NULL, hash {} NOT NULL){}",
                                   integer, integer, blob, options)));
  const std::vector<Value> genesis = {Bytes(32, 0)};
  SIXPOINT_CHECK(database.execute("INSERT INTO head VALUES (1, 0, $1)", genesis));
  // Attachments are named by their content, and rows of the history name them by it.
  SIXPOINT_CHECK(database.execute(fmt::format(
      "CREATE TABLE attachments (sha256 TEXT PRIMARY KEY, bytes {} NOT NULL){}", blob, options)));
  std::vector<std::string> statements = database.append_only_statements("attachments");
  for (const Table& table : tables()) {
    statements.push_back(create_statement(table, database));
    int number = 0;
    for (const std::string_view columns : table.indexes) {
      statements.push_back(
          fmt::format("CREATE INDEX {0}_by_{1} ON {0} ({2})", table.name, ++number, columns));
    }
    for (std::string& statement : database.append_only_statements(std::string(table.name))) {
      statements.push_back(std::move(statement));
    }
  }
  for (const std::string& statement : statements) {
    SIXPOINT_CHECK(database.execute(statement));
  }
  return {};
}

}  // namespace

Status migrate(Database& database) {
  SIXPOINT_ASSIGN(const auto before, database.schema_version());
  if (before == kSchemaVersion) {
    return {};
  }
  if (before > kSchemaVersion) {
    return fail(ErrorCode::configuration,
                fmt::format("the store has version {}, this program knows versions up to {}",
                            before, kSchemaVersion),
                database.location(), "use the sixpoint that made it, or a newer one");
  }
  SIXPOINT_CHECK(database.begin_writing());
  const auto bring_up = [&]() -> Status {
    // Another process may have done it while this one waited for the lock.
    SIXPOINT_ASSIGN(const auto version, database.schema_version());
    if (version < 1) {
      SIXPOINT_CHECK(create_version_1(database));
      SIXPOINT_CHECK(database.set_schema_version(1));
    }
    return database.commit();
  };
  Status status = bring_up();
  if (!status) {
    database.roll_back();
  }
  return status;
}

}  // namespace sixpoint::db
