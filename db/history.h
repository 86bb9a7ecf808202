// The store's rows over all tables in the order of their chain: to check, copy and continue it.
//
//   std::size_t rows = 0;
//   SIXPOINT_CHECK(for_each_history_row(database, [&](const HistoryRow& row) {
//     ++rows;  // row.seq, row.columns
//     return Status{};
//   }));
#pragma once

#include <optional>

#include "db/chain.h"
#include "db/schema.h"
#include "db/servers/database.h"

namespace sixpoint::db {

// One row as it is stored. Its columns and hash are views that the next row overwrites.
struct HistoryRow {
  const Table* table = nullptr;
  std::int64_t seq = 0;
  std::span<const Value> columns;      // in the order of the schema, without seq and hash
  std::span<const std::uint8_t> hash;  // empty where something else than bytes stands there
};

struct Head {
  std::int64_t rows = 0;
  Bytes hash = Bytes(32, 0);
};

Result<Head> read_head(Database& database);

// All rows in the order of seq; rows with the same seq (which only tampering makes) follow each
// other. Inside a reading transaction. An error of `visit` ends it.
Status for_each_history_row(Database& database,
                            const std::function<Status(const HistoryRow&)>& visit);

// One table's rows in the order of seq: seq, its columns, hash. Inside a reading transaction.
Result<std::unique_ptr<RowStream>> all_rows(Database& database, const Table& table);

// Adds rows at the end of the chain. Inside a writing transaction; finish() before its commit.
class HistoryWriter {
 public:
  static Result<HistoryWriter> open(Database& database);

  const Head& head() const { return head_; }
  // Chains a new row to the end.
  Status append(const Table& table, std::span<const Value> columns);
  // A row of another store, which must be the next one of this chain: bad_data where seq or hash
  // say otherwise.
  Status append_copy(const HistoryRow& row);
  Status add_attachment(const std::string& sha256, Bytes bytes);
  Status finish();

 private:
  HistoryWriter(Database& database, Head head) : database_(&database), head_(std::move(head)) {}
  Status insert(const Table& table, std::span<const Value> columns, const Sha256Digest& hash);
  Database* database_;
  Head head_;
  ChainHasher hasher_;
};

// "row 17 (constants 3f2a...)"
std::string name_of(const HistoryRow& row);

// All attachments, one in memory at a time. `visit(sha256, bytes)`.
Status for_each_attachment(Database& database,
                           const std::function<Status(const std::string&, const Bytes&)>& visit);

}  // namespace sixpoint::db
