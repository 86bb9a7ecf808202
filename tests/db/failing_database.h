// A database in memory of which one call fails, for tests that let each one fail in turn.
//
//   auto database = std::make_unique<FailingDatabase>();
//   FailingDatabase& server = *database;
//   auto store = Store::in(env, std::move(database));
//   server.fail_at(2);  // the third call from now answers `io`, and no other
//   ...
//   EXPECT_TRUE(server.has_failed());
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "db/servers/database.h"

namespace sixpoint::db::tests {

class FailingDatabase final : public Database {
 public:
  void fail_at(std::size_t call) {
    const std::lock_guard lock(mutex_);
    left_ = call;
    failed_ = false;
  }
  void stop_failing() {
    const std::lock_guard lock(mutex_);
    left_.reset();
  }
  // From now on copy_to_file() says that it is done, and there is no file.
  void lose_copies() { loses_copies_ = true; }
  bool has_failed() const {
    const std::lock_guard lock(mutex_);
    return failed_;
  }

  Status begin_writing() override {
    SIXPOINT_CHECK(next_call());
    return database_->begin_writing();
  }
  Status begin_reading() override {
    SIXPOINT_CHECK(next_call());
    return database_->begin_reading();
  }
  Status commit() override {
    SIXPOINT_CHECK(next_call());
    return database_->commit();
  }
  void roll_back() override { database_->roll_back(); }
  Status execute(const std::string& sql, std::span<const Value> parameters) override {
    SIXPOINT_CHECK(next_call());
    return database_->execute(sql, parameters);
  }
  Result<std::unique_ptr<RowStream>> stream(const std::string& sql,
                                            std::span<const Value> parameters) override {
    SIXPOINT_CHECK(next_call());
    SIXPOINT_ASSIGN(auto rows, database_->stream(sql, parameters));
    return std::make_unique<FailingRows>(*this, std::move(rows));
  }
  Result<std::vector<Row>> query(const std::string& sql,
                                 std::span<const Value> parameters) override {
    SIXPOINT_CHECK(next_call());
    return database_->query(sql, parameters);
  }
  Result<std::int64_t> schema_version() override {
    SIXPOINT_CHECK(next_call());
    return database_->schema_version();
  }
  Status set_schema_version(std::int64_t version) override {
    SIXPOINT_CHECK(next_call());
    return database_->set_schema_version(version);
  }
  std::vector<std::string> append_only_statements(const std::string& table) const override {
    return database_->append_only_statements(table);
  }
  std::string blob_type() const override { return database_->blob_type(); }
  std::string integer_type() const override { return database_->integer_type(); }
  std::string table_options() const override { return database_->table_options(); }
  const std::string& location() const override { return database_->location(); }
  Result<std::vector<std::string>> check_indexes() override {
    SIXPOINT_CHECK(next_call());
    return database_->check_indexes();
  }
  Result<bool> copy_to_file(const std::string& path) override {
    SIXPOINT_CHECK(next_call());
    return loses_copies_ ? Result<bool>(true) : database_->copy_to_file(path);
  }

 private:
  class FailingRows final : public RowStream {
   public:
    FailingRows(FailingDatabase& database, std::unique_ptr<RowStream> rows)
        : database_(database), rows_(std::move(rows)) {}
    Result<bool> next(Row& row) override {
      SIXPOINT_CHECK(database_.next_call());
      return rows_->next(row);
    }

   private:
    FailingDatabase& database_;
    std::unique_ptr<RowStream> rows_;
  };

  Status next_call() {
    const std::lock_guard lock(mutex_);
    if (!left_.has_value()) {
      return {};
    }
    if (*left_ == 0) {
      left_.reset();
      failed_ = true;
      return fail(ErrorCode::io, "this call fails", location(), "try again");
    }
    --*left_;
    return {};
  }

  std::unique_ptr<Database> database_ = open_sqlite_in_memory().value();
  mutable std::mutex mutex_;  // an audit asks for the indexes on a thread of its own
  bool loses_copies_ = false;
  std::optional<std::size_t> left_;  // calls before the one that fails
  bool failed_ = false;
};

}  // namespace sixpoint::db::tests
