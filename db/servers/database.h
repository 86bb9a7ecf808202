// The seam between the store and an SQL server: the few things that the store asks of one.
//
//   SIXPOINT_ASSIGN(const auto reading, Transaction::reading(database));
//   SIXPOINT_ASSIGN(const std::vector<Row> rows, database.query("SELECT serial FROM units"));
//
// Statements are written once, in the SQL that SQLite and PostgreSQL share, with parameters $1, $2
// ... in order of their first use. One Database is one connection and belongs to one thread at a
// time; several processes may each have one on the same store.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/env.h"
#include "base/result.h"

namespace sixpoint::db {

// NULL, INTEGER (64 bits), TEXT, BLOB. There is no floating point: measured numbers are kept as the
// JSON text that was written, so that both servers return the very same bytes and hashes agree.
using Value = std::variant<std::monostate, std::int64_t, std::string, Bytes>;
using Row = std::vector<Value>;

// What a column holds, or the empty text and 0 where it is NULL or of another type.
std::string text_of(const Value& value);
std::int64_t integer_of(const Value& value);
// Times are stored as nanoseconds since 1970 UTC.
inline std::int64_t to_ns(UtcTime time) { return time.time_since_epoch().count(); }
inline UtcTime from_ns(std::int64_t ns) { return UtcTime(std::chrono::nanoseconds(ns)); }

// Rows that come one at a time, so that ten million of them need no memory.
class RowStream {
 public:
  virtual ~RowStream() = default;
  // False at the end. `row` keeps its storage between calls.
  virtual Result<bool> next(Row& row) = 0;
};

// Visits every row that is left. An error of `visit` ends it.
Status for_each_row(RowStream& rows, const std::function<Status(const Row&)>& visit);

class Database {
 public:
  virtual ~Database() = default;

  // Starts a transaction that no other writer can interleave with; waits for other writers.
  virtual Status begin_writing() = 0;
  // Starts a transaction that sees the store as it is now, whatever others write meanwhile. It ends
  // with roll_back().
  virtual Status begin_reading() = 0;
  virtual Status commit() = 0;   // durable when it returns
  virtual void roll_back() = 0;  // does nothing outside a transaction

  virtual Status execute(const std::string& sql, std::span<const Value> parameters = {}) = 0;
  // For long answers; inside a transaction, which must outlive the stream. Several may be open.
  virtual Result<std::unique_ptr<RowStream>> stream(const std::string& sql,
                                                    std::span<const Value> parameters = {}) = 0;
  // All rows of a query that is known to be short. The statement is compiled once.
  virtual Result<std::vector<Row>> query(const std::string& sql,
                                         std::span<const Value> parameters = {}) = 0;

  // The version of the schema that the store has; 0 for an empty one.
  virtual Result<std::int64_t> schema_version() = 0;
  virtual Status set_schema_version(std::int64_t version) = 0;  // inside a transaction
  // The statements that make `table` refuse every UPDATE and DELETE.
  virtual std::vector<std::string> append_only_statements(const std::string& table) const = 0;
  virtual std::string blob_type() const = 0;        // BLOB or BYTEA
  virtual std::string integer_type() const = 0;     // a name for 64 bits
  virtual std::string table_options() const = 0;    // " STRICT" where the server knows it
  virtual const std::string& location() const = 0;  // for error messages; without a password

  // What is wrong with the server's own files: pages, and indexes that do not say what the tables
  // say, so that a question would get another answer than the rows give. One sentence each, the
  // first 20; empty where nothing is, or nothing known. Its own connection: beside another call.
  virtual Result<std::vector<std::string>> check_indexes() = 0;

  // Makes `path`, a file that is not there yet, a copy of the whole store as it is now, while
  // others go on working; false where the server has no such means (and nothing was made).
  virtual Result<bool> copy_to_file(const std::string& path) = 0;
};

// A transaction that is undone unless commit() was called.
class Transaction {
 public:
  static Result<Transaction> writing(Database& database);
  static Result<Transaction> reading(Database& database);
  Transaction(Transaction&& other) noexcept;
  Transaction& operator=(Transaction&&) = delete;
  ~Transaction();
  Status commit();

 private:
  explicit Transaction(Database& database) : database_(&database) {}
  Database* database_;
};

enum class Access : std::uint8_t { write, read };

// An SQLite file. WAL mode, every commit synced, foreign keys on; a writer waits up to 30 s for
// another.
//
// | what is at `path`                 | to write                 | to read                  |
// |-----------------------------------|--------------------------|--------------------------|
// | nothing                           | made, its owner's alone  | no_input                 |
// | an empty file or database         | becomes a store          | bad_data                 |
// | a store                           | opened                   | opened                   |
// | a store that may not be written   | permission               | opened                   |
// | a database of another program     | bad_data, left untouched | bad_data, left untouched |
// | another file, a folder, a device  | bad_data, left untouched | bad_data, left untouched |
// | a link that leads nowhere         | cannot_create            | no_input                 |
//
// Besides: cannot_create without its folder, permission for a place where nothing can be read, io
// for a full disk, bad_data for damage.
Result<std::unique_ptr<Database>> open_sqlite(const std::string& path,
                                              Access access = Access::write);
// A store that ends with its object: for tests.
Result<std::unique_ptr<Database>> open_sqlite_in_memory();

// A PostgreSQL database (postgresql://user:password@host:port/name, as libpq takes it; a password
// may also come from PGPASSWORD or ~/.pgpass, which other users cannot see in the process list).
// A connection that the server dropped is made anew by the next transaction. Errors:
// device_unavailable where the server does not answer, went away or has no room; permission for a
// wrong password or missing rights; no_input for a database that is not there; bad_data for one
// that holds other tables. No message ever holds the password.
Result<std::unique_ptr<Database>> open_postgres(const std::string& location);

}  // namespace sixpoint::db
