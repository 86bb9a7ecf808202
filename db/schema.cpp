#include "db/schema.h"

#include <algorithm>
#include <cassert>

#include <fmt/format.h>

namespace sixpoint::db {

namespace {

Column added(std::string_view name, ColumnType type = ColumnType::text) {
  return {.name = name, .type = type, .required = false, .since = 2};
}

}  // namespace

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
        {.name = "document"},
        added("jig_due_ns", ColumnType::integer),  // when the jig itself is due for calibration
        added("build"),                            // of the software: commit or package version
        added("limits"),                           // JSON: the limits that the verdict used
        added("gravity_m_per_s2"),                 // local gravity, a JSON number
        added("temperature_c"),                    // of the unit during the run, a JSON number
        added("codes")},                           // JSON: the verdict's reasons, an array
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
        {.name = "document"},
        added("standard_uncertainty"),  // JSON
        added("origin")},               // JSON: the file or the run, with its SHA-256
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
        {.name = "document"},
        added("software")},
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
      {.name = "filter_configurations",
       .columns = {{.name = "name", .since = 2}, {.name = "meaning", .since = 2}},
       .since = 2},
      {.name = "station_events",
       .columns = {{.name = "id", .since = 3},
                   {.name = "made_at_ns", .type = ColumnType::integer, .since = 3},
                   {.name = "station", .since = 3},
                   {.name = "serial", .since = 3},  // the unit that it is about, or empty
                   {.name = "action", .since = 3},  // StationEvent in store.h
                   {.name = "operator", .since = 3},
                   {.name = "reason", .since = 3}},
       .indexes = {"station", "serial"},
       .since = 3},
  };
  return kTables;
}

const Table* find_table(std::string_view name) {
  const auto found = std::find_if(tables().begin(), tables().end(),
                                  [&](const Table& table) { return table.name == name; });
  return found == tables().end() ? nullptr : &*found;
}

const Table& table(std::string_view name) {
  const Table* found = find_table(name);
  assert(found != nullptr);
  return *found;
}

std::string column_list(const Table& table) {
  std::string list = "seq";
  for (const Column& column : table.columns) {
    list += fmt::format(", {}", column.name);
  }
  return list + ", hash";
}

namespace {

std::string type_of(const Column& column, const Database& database) {
  return column.type == ColumnType::integer ? database.integer_type() : std::string("TEXT");
}

// The table as its first version had it.
std::vector<std::string> create_statements(const Table& table, const Database& database) {
  std::string sql =
      fmt::format("CREATE TABLE {} (seq {} PRIMARY KEY", table.name, database.integer_type());
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const Column& column = table.columns[i];
    if (column.since > table.since) {
      continue;
    }
    sql += fmt::format(", {} {}{}{}", column.name, type_of(column, database),
                       column.required ? " NOT NULL" : "", i == 0 ? " UNIQUE" : "");
    if (!column.references.empty()) {
      sql += fmt::format(" REFERENCES {}", column.references);
    }
  }
  std::vector<std::string> statements = {
      sql + fmt::format(", hash {} NOT NULL){}", database.blob_type(), database.table_options())};
  int number = 0;
  for (const std::string_view columns : table.indexes) {
    statements.push_back(
        fmt::format("CREATE INDEX {0}_by_{1} ON {0} ({2})", table.name, ++number, columns));
  }
  for (std::string& statement : database.append_only_statements(std::string(table.name))) {
    statements.push_back(std::move(statement));
  }
  return statements;
}

std::vector<std::string> version_1_statements(const Database& database) {
  const std::string blob = database.blob_type();
  const std::string options = database.table_options();
  const std::string integer = database.integer_type();
  std::vector<std::string> statements = {
      // One row: how many rows the history has and the hash of the last one. The only row that
      // changes.
      fmt::format("CREATE TABLE head (one {} PRIMARY KEY CHECK (one = 1), rows {} NOT NULL, hash "
                  "{} NOT NULL){}",
                  integer, integer, blob, options),
      // Attachments are named by their content, and rows of the history name them by it.
      fmt::format("CREATE TABLE attachments (sha256 TEXT PRIMARY KEY, bytes {} NOT NULL){}", blob,
                  options)};
  for (std::string& statement : database.append_only_statements("attachments")) {
    statements.push_back(std::move(statement));
  }
  return statements;
}

// From `version` - 1 to `version`: its tables, and its columns in older tables. Rows stay as they
// are, and so do their hashes (chain.h).
Status bring_to(std::int64_t version, Database& database) {
  std::vector<std::string> statements;
  if (version == 1) {
    statements = version_1_statements(database);
  }
  for (const Table& table : tables()) {
    if (table.since == version) {
      for (std::string& statement : create_statements(table, database)) {
        statements.push_back(std::move(statement));
      }
      continue;
    }
    for (const Column& column : table.columns) {
      if (table.since < version && column.since == version) {
        statements.push_back(fmt::format("ALTER TABLE {} ADD COLUMN {} {}", table.name, column.name,
                                         type_of(column, database)));
      }
    }
  }
  for (const std::string& statement : statements) {
    SIXPOINT_CHECK(database.execute(statement));
  }
  if (version == 1) {
    const std::vector<Value> genesis = {Bytes(32, 0)};
    SIXPOINT_CHECK(database.execute("INSERT INTO head VALUES (1, 0, $1)", genesis));
  }
  return database.set_schema_version(version);
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
  SIXPOINT_ASSIGN(auto transaction, Transaction::writing(database));
  // Another process may have done it while this one waited for the lock.
  SIXPOINT_ASSIGN(const auto version, database.schema_version());
  for (std::int64_t next = version + 1; next <= kSchemaVersion; ++next) {
    SIXPOINT_CHECK(bring_to(next, database));
  }
  return transaction.commit();
}

}  // namespace sixpoint::db
