// The store's rows over all tables in the order of their chain: to check, copy and continue it.
#pragma once

#include <optional>

#include "db/chain.h"
#include "db/database.h"
#include "db/schema.h"

namespace sixpoint::db {

// One row as it is stored. Views into the reader's buffers until its next call.
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
// other. Inside a reading transaction.
class HistoryReader {
 public:
  static Result<HistoryReader> open(Database& database);
  Result<bool> next(HistoryRow& row);  // false at the end

 private:
  struct Cursor {
    const Table* table;
    std::unique_ptr<RowStream> rows;
    Row row;
    bool more;
  };
  std::vector<Cursor> cursors_;
  std::size_t given_ = 0;  // index of the cursor whose row the caller has, plus 1
};

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
