#include "db/servers/database.h"

namespace sixpoint::db {

std::string text_of(const Value& value) {
  const auto* text = std::get_if<std::string>(&value);
  return text == nullptr ? std::string() : *text;
}

std::int64_t integer_of(const Value& value) {
  const auto* integer = std::get_if<std::int64_t>(&value);
  return integer == nullptr ? 0 : *integer;
}

Status for_each_row(RowStream& rows, const std::function<Status(const Row&)>& visit) {
  Row row;
  while (true) {
    SIXPOINT_ASSIGN(const bool more, rows.next(row));
    if (!more) {
      return {};
    }
    SIXPOINT_CHECK(visit(row));
  }
}

Result<Transaction> Transaction::writing(Database& database) {
  SIXPOINT_CHECK(database.begin_writing());
  return Transaction(database);
}

Result<Transaction> Transaction::reading(Database& database) {
  SIXPOINT_CHECK(database.begin_reading());
  return Transaction(database);
}

Transaction::Transaction(Transaction&& other) noexcept
    : database_(std::exchange(other.database_, nullptr)) {}

Transaction::~Transaction() {
  if (database_ != nullptr) {
    database_->roll_back();
  }
}

Status Transaction::commit() {
  Status status = database_->commit();
  if (status) {
    database_ = nullptr;
  }
  return status;
}

}  // namespace sixpoint::db
