#include "db/history.h"

#include <algorithm>

#include <fmt/format.h>

namespace sixpoint::db {

Result<Head> read_head(Database& database) {
  SIXPOINT_ASSIGN(auto rows, database.query("SELECT rows, hash FROM head"));
  auto* hash = rows.size() == 1 ? std::get_if<Bytes>(&rows[0][1]) : nullptr;
  if (hash == nullptr || hash->size() != 32) {
    return fail(ErrorCode::bad_data, "the head of the history is missing", database.location(),
                "restore the last backup");
  }
  return Head{integer_of(rows[0][0]), std::move(*hash)};
}

Result<HistoryReader> HistoryReader::open(Database& database) {
  HistoryReader reader;
  for (const Table& table : tables()) {
    SIXPOINT_ASSIGN(auto rows, database.stream(fmt::format("SELECT {} FROM {} ORDER BY seq",
                                                           column_list(table), table.name)));
    Cursor cursor{&table, std::move(rows), {}, false};
    SIXPOINT_ASSIGN(cursor.more, cursor.rows->next(cursor.row));
    reader.cursors_.push_back(std::move(cursor));
  }
  return reader;
}

Result<bool> HistoryReader::next(HistoryRow& row) {
  if (given_ > 0) {
    Cursor& given = cursors_[given_ - 1];
    SIXPOINT_ASSIGN(given.more, given.rows->next(given.row));
  }
  given_ = 0;
  for (std::size_t i = 0; i < cursors_.size(); ++i) {
    const Cursor& cursor = cursors_[i];
    if (!cursor.more) {
      continue;
    }
    const std::int64_t seq = integer_of(cursor.row[0]);
    if (given_ == 0 || seq < row.seq) {
      row.seq = seq;
      given_ = i + 1;
    }
  }
  if (given_ == 0) {
    return false;
  }
  const Cursor& first = cursors_[given_ - 1];
  row.table = first.table;
  row.columns = std::span<const Value>(first.row).subspan(1, first.row.size() - 2);
  const auto* hash = std::get_if<Bytes>(&first.row.back());
  row.hash = hash == nullptr ? std::span<const std::uint8_t>() : std::span(*hash);
  return true;
}

Result<HistoryWriter> HistoryWriter::open(Database& database) {
  SIXPOINT_ASSIGN(Head head, read_head(database));
  return HistoryWriter(database, std::move(head));
}

Status HistoryWriter::insert(const Table& table, std::span<const Value> columns,
                             const Sha256Digest& hash) {
  Row row = {Value(head_.rows + 1)};
  row.insert(row.end(), columns.begin(), columns.end());
  row.emplace_back(Bytes(hash.begin(), hash.end()));
  std::string places;
  for (std::size_t i = 1; i <= row.size(); ++i) {
    places += fmt::format("{}${}", i == 1 ? "" : ", ", i);
  }
  SIXPOINT_CHECK(database_->execute(
      fmt::format("INSERT INTO {} ({}) VALUES ({})", table.name, column_list(table), places), row));
  ++head_.rows;
  head_.hash.assign(hash.begin(), hash.end());
  return {};
}

Status HistoryWriter::append(const Table& table, std::span<const Value> columns) {
  return insert(table, columns, hasher_.hash(head_.hash, table, head_.rows + 1, columns));
}

Status HistoryWriter::append_copy(const HistoryRow& row) {
  if (row.seq != head_.rows + 1) {
    return fail(ErrorCode::bad_data,
                fmt::format("{} cannot follow row {}", name_of(row), head_.rows),
                database_->location(), "rows are missing or out of order: export again");
  }
  const Sha256Digest hash = hasher_.hash(head_.hash, *row.table, row.seq, row.columns);
  if (!std::equal(hash.begin(), hash.end(), row.hash.begin(), row.hash.end())) {
    return fail(ErrorCode::bad_data,
                fmt::format("{} does not fit the chain: it was changed, or it belongs to another "
                            "store",
                            name_of(row)),
                database_->location(),
                "run 'audit verify' on the store that it came from and export again");
  }
  auto status = insert(*row.table, row.columns, hash);
  if (!status) {
    Error error = std::move(status).error();
    error.what = fmt::format("{}: {}", name_of(row), error.what);
    return fail(std::move(error));
  }
  return {};
}

Status HistoryWriter::add_attachment(const std::string& sha256, Bytes bytes) {
  const std::vector<Value> name = {sha256};
  SIXPOINT_ASSIGN(const auto there,
                  database_->query("SELECT 1 FROM attachments WHERE sha256 = $1", name));
  if (!there.empty()) {
    return {};
  }
  const std::vector<Value> attachment = {sha256, std::move(bytes)};
  return database_->execute("INSERT INTO attachments (sha256, bytes) VALUES ($1, $2)", attachment);
}

Status HistoryWriter::finish() {
  const std::vector<Value> head = {head_.rows, head_.hash};
  return database_->execute("UPDATE head SET rows = $1, hash = $2 WHERE one = 1", head);
}

std::string name_of(const HistoryRow& row) {
  return fmt::format("row {} ({} {})", row.seq, row.table->name,
                     printable(row.columns.empty() ? "" : text_of(row.columns[0]), 60));
}

Status for_each_attachment(Database& database,
                           const std::function<Status(const std::string&, const Bytes&)>& visit) {
  SIXPOINT_ASSIGN(const auto names, database.stream("SELECT sha256 FROM attachments"));
  Row name;
  while (true) {
    SIXPOINT_ASSIGN(const bool more, names->next(name));
    if (!more) {
      return {};
    }
    SIXPOINT_ASSIGN(const auto rows,
                    database.query("SELECT bytes FROM attachments WHERE sha256 = $1", name));
    const auto* bytes = rows.empty() ? nullptr : std::get_if<Bytes>(&rows[0][0]);
    SIXPOINT_CHECK(visit(text_of(name[0]), bytes == nullptr ? Bytes() : *bytes));
  }
}

}  // namespace sixpoint::db
