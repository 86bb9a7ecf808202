// The tables of the store as data: from this list come the SQL of both servers, the canonical bytes
// that are hashed, and the export.
//
//   const Table& units = table("units");
//   column_list(units);  // "seq, serial, ..., hash"
//
// Every table has, before its own columns, `seq` (the row's place in the whole store's history: 1,
// 2, 3 ... over all tables together) and, after them, `hash` (the chain, see chain.h). Times are
// nanoseconds since 1970 UTC. Columns named `document` hold JSON as it was written.
//
// Versions: 1 the first; 2 adds to a run the jig's due date, the build, the limits, local gravity,
// temperature and codes, to constants their uncertainty and origin, to a repair the software, and
// the filter configurations; 3 adds the station's events.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "db/servers/database.h"

namespace sixpoint::db {

inline constexpr std::int64_t kSchemaVersion = 3;

enum class ColumnType { integer, text };

// What a text column may hold; new rows are checked against it (records.h).
enum class Content {
  name,    // UTF-8, up to 200 bytes
  reason,  // UTF-8, up to 20,000 bytes
  text,    // UTF-8, up to 64 MiB
  serial,  // 1 to 200 bytes of printable UTF-8
  filter,  // "legacy" or "current"
  json     // a JSON document, up to 64 MiB
};

struct Column {
  std::string_view name;
  ColumnType type = ColumnType::text;
  bool required = true;
  std::string_view references = {};  // "table(column)" of a foreign key, or empty
  std::int64_t since = 1;            // the version that has it first; added columns may be NULL
  Content content = Content::name;
};

struct Table {
  std::string_view name;
  std::vector<Column> columns;                 // the first one is the key, unique
  std::vector<std::string_view> indexes = {};  // column lists, each becomes an index
  std::int64_t since = 1;
};

const std::vector<Table>& tables();
const Table& table(std::string_view name);       // a name that is in tables()
const Table* find_table(std::string_view name);  // nullptr where there is none
// "seq, COLUMN, COLUMN ..., hash": how a whole row is asked for.
std::string column_list(const Table& table);
// "TABLE.COLUMN, TABLE.COLUMN ...", without seq and hash: how a record is asked for.
std::string record_columns(const Table& table);

// Brings an empty store, or one of an earlier version, to kSchemaVersion in one transaction.
// configuration error for a store of a newer version than this program knows.
Status migrate(Database& database);

}  // namespace sixpoint::db
