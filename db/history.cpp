#include "db/history.h"

#include <algorithm>

#include <fmt/format.h>

namespace sixpoint::db {

Result<Head> read_head(Database& database) {
  SIXPOINT_ASSIGN(auto rows, database.query("SELECT rows, hash FROM head WHERE one = 1"));
  auto* hash = rows.size() == 1 ? std::get_if<Bytes>(&rows[0][1]) : nullptr;
  if (hash == nullptr || hash->size() != 32) {
    return fail(ErrorCode::bad_data, "the head of the history is missing", database.location(),
                "restore the last backup");
  }
  return Head{integer_of(rows[0][0]), std::move(*hash)};
}

Status for_each_history_row(Database& database,
                            const std::function<Status(const HistoryRow&)>& visit) {
  struct Cursor {
    const Table* table;
    std::unique_ptr<RowStream> rows;
    Row row;
    bool more;
  };
  std::vector<Cursor> cursors;
  for (const Table& table : tables()) {
    SIXPOINT_ASSIGN(auto rows, all_rows(database, table));
    Cursor cursor{&table, std::move(rows), {}, false};
    SIXPOINT_ASSIGN(cursor.more, cursor.rows->next(cursor.row));
    cursors.push_back(std::move(cursor));
  }
  while (true) {
    Cursor* first = nullptr;
    for (Cursor& cursor : cursors) {
      if (cursor.more &&
          (first == nullptr || integer_of(cursor.row[0]) < integer_of(first->row[0]))) {
        first = &cursor;
      }
    }
    if (first == nullptr) {
      return {};
    }
    const auto* hash = std::get_if<Bytes>(&first->row.back());
    SIXPOINT_CHECK(visit({first->table, integer_of(first->row[0]),
                          std::span<const Value>(first->row).subspan(1, first->row.size() - 2),
                          hash == nullptr ? std::span<const std::uint8_t>() : std::span(*hash)}));
    SIXPOINT_ASSIGN(first->more, first->rows->next(first->row));
  }
}

Result<std::unique_ptr<RowStream>> all_rows(Database& database, const Table& table) {
  return database.stream(
      fmt::format("SELECT {} FROM {} ORDER BY seq", column_list(table), table.name));
}

Result<HistoryWriter> HistoryWriter::open(Database& database) {
  SIXPOINT_ASSIGN(Head head, read_head(database));
  return HistoryWriter(database, std::move(head));
}

namespace {

// A trigger that is not ours can swallow a row, or its change, without an error.
Status keeps_nothing(Database& database, std::string_view table) {
  return fail(ErrorCode::bad_data,
              fmt::format("the table '{}' does not keep what is written into it: another program "
                          "changed the store",
                          table),
              database.location(), "keep this file, and restore the last backup");
}

}  // namespace

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
  SIXPOINT_ASSIGN(const auto there,
                  database_->query(fmt::format("SELECT 1 FROM {} WHERE seq = $1", table.name),
                                   std::span<const Value>(row).first(1)));
  if (there.empty()) {
    return keeps_nothing(*database_, table.name);
  }
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
  SIXPOINT_CHECK(database_->execute("UPDATE head SET rows = $1, hash = $2 WHERE one = 1", head));
  SIXPOINT_ASSIGN(const Head kept, read_head(*database_));
  return kept.rows == head_.rows && kept.hash == head_.hash ? Status()
                                                            : keeps_nothing(*database_, "head");
}

std::string name_of(const HistoryRow& row) {
  return fmt::format("row {} ({} {})", row.seq, row.table->name,
                     printable(row.columns.empty() ? "" : text_of(row.columns[0]), 60));
}

Status for_each_attachment(Database& database,
                           const std::function<Status(const std::string&, const Bytes&)>& visit) {
  SIXPOINT_ASSIGN(const auto names, database.stream("SELECT sha256 FROM attachments"));
  return for_each_row(*names, [&](const Row& name) -> Status {
    SIXPOINT_ASSIGN(const auto rows,
                    database.query("SELECT bytes FROM attachments WHERE sha256 = $1", name));
    const auto* bytes = rows.empty() ? nullptr : std::get_if<Bytes>(&rows[0][0]);
    return visit(text_of(name[0]), bytes == nullptr ? Bytes() : *bytes);
  });
}

}  // namespace sixpoint::db
