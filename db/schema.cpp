#include "db/schema.h"

#include <algorithm>
#include <cassert>

#include <fmt/format.h>

namespace sixpoint::db {

namespace {

Column serial() {
  return {.name = "serial", .references = "units(serial)", .content = Content::serial};
}
Column serial_of_any_unit() { return {.name = "serial", .content = Content::serial}; }
Column filter() { return {.name = "filter", .content = Content::filter}; }
Column time(std::string_view name) { return {.name = name, .type = ColumnType::integer}; }
Column json(std::string_view name) { return {.name = name, .content = Content::json}; }
Column text(std::string_view name) { return {.name = name, .content = Content::text}; }
Column reason() { return {.name = "reason", .content = Content::reason}; }
Column key_of(std::string_view name, std::string_view references, bool required = true) {
  return {.name = name, .required = required, .references = references};
}
Column added(std::string_view name, Content content = Content::name,
             ColumnType type = ColumnType::text) {
  return {.name = name, .type = type, .required = false, .since = 2, .content = content};
}

// All columns of a table that came with a later version.
std::vector<Column> since(std::int64_t version, std::vector<Column> columns) {
  for (Column& column : columns) {
    column.since = version;
  }
  return columns;
}

}  // namespace

const std::vector<Table>& tables() {
  static const std::vector<Table> kTables = {
      {"units", {serial_of_any_unit(), {.name = "model"}, time("first_seen_ns")}},
      {"runs",
       {{.name = "id"},
        serial(),
        {.name = "kind"},  // jig, capture, scan
        filter(),
        time("started_ns"),
        time("ended_ns"),
        {.name = "operator"},
        {.name = "station"},
        {.name = "jig"},
        {.name = "verdict"},
        {.name = "software"},
        key_of("retest_of", "runs(id)", false),
        json("document"),
        // When the jig itself is due for calibration.
        added("jig_due_ns", Content::name, ColumnType::integer),
        added("build"),                  // of the software: commit or package version
        added("limits", Content::json),  // the limits that the verdict used
        added("gravity_m_per_s2"),       // local gravity, a JSON number
        added("temperature_c"),          // of the unit during the run, a JSON number
        added("codes", Content::json)},  // the verdict's reasons, an array
       {"serial", "jig"}},
      {"captures",
       {{.name = "id"},
        key_of("run_id", "runs(id)"),
        {.name = "name"},
        key_of("sha256", "attachments(sha256)")},
       {"run_id"}},
      {"constants",
       {{.name = "id"},
        serial(),
        filter(),
        time("made_at_ns"),
        {.name = "method"},
        key_of("run_id", "runs(id)", false),
        json("document"),
        added("standard_uncertainty", Content::json),
        added("origin", Content::json)},  // the file or the run, with its SHA-256
       {"serial, filter, made_at_ns"}},
      {"unit_writes",
       {{.name = "id"},
        key_of("run_id", "runs(id)"),
        serial(),
        time("written_ns"),
        text("as_found"),
        text("as_left"),
        text("read_back")},
       {"serial"}},
      {"repairs",
       {{.name = "id"},
        serial_of_any_unit(),  // of the file; its unit need never have been here
        time("made_at_ns"),
        text("input"),
        {.name = "input_sha256"},
        {.name = "output_sha256"},
        {.name = "method"},
        key_of("constants_id", "constants(id)", false),
        json("document"),
        added("software")},
       {"constants_id", "input_sha256", "output_sha256", "serial"}},
      {"corrections",
       {{.name = "id"},
        time("made_at_ns"),
        {.name = "about_table"},
        {.name = "about_id"},
        {.name = "action"},  // withdraw, reinstate, prefer, note
        {.name = "operator"},
        reason()},
       {"about_table, about_id"}},
      {.name = "filter_configurations",
       .columns = since(2, {{.name = "name", .content = Content::filter}, {.name = "meaning"}}),
       .since = 2},
      {.name = "station_events",
       .columns = since(3, {{.name = "id"},
                            time("made_at_ns"),
                            {.name = "station"},
                            {.name = "serial"},  // of the unit, or empty
                            {.name = "action"},  // StationEvent in records.h
                            {.name = "operator"},
                            reason()}),
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

std::string record_columns(const Table& table) {
  std::string list;
  for (const Column& column : table.columns) {
    list += fmt::format("{}{}.{}", list.empty() ? "" : ", ", table.name, column.name);
  }
  return list;
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
    if (auto status = bring_to(next, database); !status) {
      if (status.error().code != ErrorCode::internal) {
        return status;
      }
      return fail(
          ErrorCode::bad_data,
          fmt::format("the store says that it has version {}, and its tables are others: {}",
                      version, status.error().what),
          database.location(),
          "another program changed it: keep this file, and restore the last backup");
    }
  }
  return transaction.commit();
}

}  // namespace sixpoint::db
