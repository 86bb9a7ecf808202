#include <algorithm>
#include <map>
#include <optional>
#include <pqxx/pqxx>

#include <fmt/format.h>

#include "db/postgres/postgres_address.h"
#include "db/servers/database.h"
#include "db/servers/postgres_part.h"

namespace sixpoint::db {
namespace {

// "sixp" in ASCII: the advisory lock that all writers of one database queue for.
constexpr std::int64_t kWriterLock = 0x73697870;
// Of a stream, fetched from the server at a time.
constexpr int kRowsPerFetch = 1000;
// The type numbers of the server's catalogue (pg_type.dat) that the store's statements can answer.
constexpr unsigned kTypeBytea = 17;
constexpr unsigned kTypeInt8 = 20;
constexpr unsigned kTypeInt2 = 21;
constexpr unsigned kTypeInt4 = 23;

// A parameter as the text that the server reads; it knows the type from the statement.
Result<std::optional<std::string>> to_parameter(const Value& value, const std::string& where) {
  if (const auto* integer = std::get_if<std::int64_t>(&value)) {
    return std::to_string(*integer);
  }
  if (const auto* text = std::get_if<std::string>(&value)) {
    if (text->find('\0') != std::string::npos) {
      return fail(ErrorCode::bad_data, "a text with a zero byte cannot be stored by PostgreSQL",
                  where, "use an SQLite store for it");
    }
    return *text;
  }
  if (const auto* bytes = std::get_if<Bytes>(&value)) {
    return "\\x" + to_hex(*bytes);
  }
  return std::optional<std::string>();
}

// libpqxx 6 leaves the state out of this one type.
std::string state_of(const pqxx::sql_error& exception) {
  return dynamic_cast<const pqxx::insufficient_privilege*>(&exception) != nullptr
             ? "42501"
             : exception.sqlstate();
}

void read_field(const pqxx::field& field, Value& value) {
  if (field.is_null()) {
    value = std::monostate{};
    return;
  }
  const std::string_view text(field.c_str(), field.size());
  switch (field.type()) {
    case kTypeInt2:
    case kTypeInt4:
    case kTypeInt8:
      value = static_cast<std::int64_t>(std::stoll(std::string(text)));
      break;
    case kTypeBytea:  // "\\x53..."
      value = from_hex(text.substr(std::min<std::size_t>(2, text.size()))).value_or(Bytes());
      break;
    default:
      if (auto* held = std::get_if<std::string>(&value)) {
        held->assign(text);
      } else {
        value = std::string(text);
      }
  }
}

void read_fields(const pqxx::row& fields, Row& row) {
  row.resize(fields.size());
  for (pqxx::row::size_type i = 0; i < fields.size(); ++i) {
    read_field(fields[i], row[i]);
  }
}

class PostgresDatabase final : public Database {
 public:
  explicit PostgresDatabase(PostgresAddress address) : address_(std::move(address)) {}

  Status connect() {
    return guarded([&]() -> Status {
      quiet_.reset();
      connection_.reset();
      prepared_.clear();
      in_transaction_ = false;
      auto connection = std::make_unique<pqxx::connection>(address_.connection);
      // Notices go nowhere: libraries do not print. The connection owns its reference.
      quiet_ = std::make_unique<pqxx::quiet_errorhandler>(*connection);
      connection_ = std::move(connection);
      // Whatever the server's or the user's defaults: texts as they are, every commit on the disk,
      // no endless waiting for a writer that hangs.
      plain("SET standard_conforming_strings = on");
      plain("SET bytea_output = hex");
      plain("SET synchronous_commit = on");
      plain("SET lock_timeout = '30s'");
      plain("SET lc_messages = 'C'", true);
      return {};
    });
  }

  Status check_owner() {
    SIXPOINT_ASSIGN(const auto encoding, query("SHOW server_encoding", {}));
    if (text_of(encoding[0][0]) != "UTF8") {
      return fail(ErrorCode::configuration,
                  fmt::format("the database keeps texts as {}", text_of(encoding[0][0])),
                  address_.shown, "make a database with ENCODING 'UTF8'");
    }
    SIXPOINT_ASSIGN(const auto tables,
                    query("SELECT count(*), count(*) FILTER (WHERE tablename = 'sixpoint_schema') "
                          "FROM pg_tables WHERE schemaname = current_schema()",
                          {}));
    if (integer_of(tables[0][0]) > 0 && integer_of(tables[0][1]) == 0) {
      return fail(ErrorCode::bad_data, "the database has tables, but is no store of sixpoint",
                  address_.shown, "make an empty database for the store: createdb NAME");
    }
    return {};
  }

  Status begin_writing() override {
    SIXPOINT_CHECK(begin("BEGIN ISOLATION LEVEL READ COMMITTED READ WRITE"));
    // Not a lock on a row of `head`: a store that is being made has no such row yet.
    Status locked = guarded([&]() -> Status {
      plain(fmt::format("SELECT pg_advisory_xact_lock({})", kWriterLock));
      return {};
    });
    if (!locked) {
      roll_back();
    }
    return locked;
  }

  Status begin_reading() override {
    return begin("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY");
  }

  Status commit() override {
    Status status = guarded([&]() -> Status {
      plain("COMMIT");
      in_transaction_ = false;
      return {};
    });
    if (!status && status.error().code == ErrorCode::device_unavailable) {
      Error error = std::move(status).error();
      error.what += " while it was storing the row: whether it did is not known";
      error.hint = "run the command again: a row that is there already is not stored twice";
      return fail(std::move(error));
    }
    return status;
  }

  void roll_back() override {
    if (!in_transaction_) {
      return;
    }
    in_transaction_ = false;
    // A connection that cannot even do this is of no more use; the server undoes the rest itself.
    if (!guarded([&]() -> Status {
          plain("ROLLBACK");
          return {};
        })) {
      connection_.reset();
    }
  }

  Status execute(const std::string& sql, std::span<const Value> parameters) override {
    return guarded([&]() -> Status {
      SIXPOINT_CHECK(answer(sql, parameters));
      return {};
    });
  }

  Result<std::vector<Row>> query(const std::string& sql,
                                 std::span<const Value> parameters) override {
    const auto attempt = [&] {
      return guarded([&]() -> Result<std::vector<Row>> {
        SIXPOINT_ASSIGN(const pqxx::result result, answer(sql, parameters));
        std::vector<Row> rows;
        rows.reserve(result.size());
        for (const pqxx::row& row : result) {
          read_fields(row, rows.emplace_back());
        }
        return rows;
      });
    };
    const bool alone = !in_transaction_;
    auto rows = attempt();
    // Nothing is lost by asking again when the server was restarted since the last question.
    if (!rows && alone && !is_open() && connect()) {
      rows = attempt();
    }
    return rows;
  }

  Result<std::unique_ptr<RowStream>> stream(const std::string& sql,
                                            std::span<const Value> parameters) override;

  Result<std::int64_t> schema_version() override {
    SIXPOINT_ASSIGN(
        const auto there,
        query("SELECT count(*) FROM pg_tables WHERE schemaname = current_schema() AND tablename = "
              "'sixpoint_schema'",
              {}));
    if (integer_of(there[0][0]) == 0) {
      return 0;
    }
    SIXPOINT_ASSIGN(const auto rows, query("SELECT version FROM sixpoint_schema", {}));
    return rows.empty() ? 0 : integer_of(rows[0][0]);
  }

  Status set_schema_version(std::int64_t version) override {
    SIXPOINT_CHECK(
        execute("CREATE TABLE IF NOT EXISTS sixpoint_schema (one BIGINT PRIMARY KEY CHECK "
                "(one = 1), version BIGINT NOT NULL)",
                {}));
    return execute(fmt::format("INSERT INTO sixpoint_schema VALUES (1, {0}) ON CONFLICT (one) DO "
                               "UPDATE SET version = {0}",
                               version),
                   {});
  }

  std::vector<std::string> append_only_statements(const std::string& table) const override {
    return {
        "CREATE OR REPLACE FUNCTION sixpoint_refuse() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
        "RAISE EXCEPTION 'history never changes: write a correction instead'; END $$",
        fmt::format("CREATE TRIGGER {0}_no_change BEFORE UPDATE OR DELETE ON {0} FOR EACH ROW "
                    "EXECUTE FUNCTION sixpoint_refuse()",
                    table),
        fmt::format("CREATE TRIGGER {0}_no_truncate BEFORE TRUNCATE ON {0} FOR EACH STATEMENT "
                    "EXECUTE FUNCTION sixpoint_refuse()",
                    table)};
  }
  std::string blob_type() const override { return "BYTEA"; }
  std::string integer_type() const override { return "BIGINT"; }
  std::string table_options() const override { return ""; }
  const std::string& location() const override { return address_.shown; }
  // The server checks its own files (pg_amcheck, data checksums).
  Result<std::vector<std::string>> check_indexes() override { return std::vector<std::string>(); }
  Result<bool> copy_to_file(const std::string& /*path*/) override { return false; }

 private:
  friend class PostgresRows;

  bool is_open() const { return connection_ != nullptr && connection_->is_open(); }

  Status begin(const std::string& sql) {
    const auto attempt = [&] {
      return guarded([&]() -> Status {
        plain(sql);
        in_transaction_ = true;
        return {};
      });
    };
    if (is_open()) {
      Status begun = attempt();
      if (begun || is_open()) {
        return begun;
      }
    }
    SIXPOINT_CHECK(connect());
    return attempt();
  }

  // One statement without parameters. Throws what libpqxx throws.
  void plain(const std::string& sql, bool may_fail = false) {
    pqxx::nontransaction work(*connection_);
    try {
      work.exec(sql);
    } catch (const pqxx::sql_error&) {
      if (!may_fail) {
        throw;
      }
    }
  }

  // Inside guarded().
  Result<pqxx::result> answer(const std::string& sql, std::span<const Value> parameters) {
    if (connection_ == nullptr) {
      return fail(gone("the connection was lost"));
    }
    pqxx::nontransaction work(*connection_);
    if (parameters.empty()) {
      return work.exec(sql);
    }
    std::vector<std::optional<std::string>> texts;
    for (const Value& value : parameters) {
      SIXPOINT_ASSIGN(texts.emplace_back(), to_parameter(value, address_.shown));
    }
    std::vector<const char*> pointers;
    pointers.reserve(texts.size());
    for (const auto& text : texts) {
      pointers.push_back(text ? text->c_str() : nullptr);
    }
    if (sql.starts_with("DECLARE")) {
      return work.exec_params(sql, pqxx::prepare::make_dynamic_params(pointers));
    }
    auto [found, is_new] = prepared_.try_emplace(sql);
    if (is_new) {
      found->second = fmt::format("sixpoint_{}", prepared_.size());
      connection_->prepare(found->second, sql);
    }
    return work.exec_prepared(found->second, pqxx::prepare::make_dynamic_params(pointers));
  }

  // What the server or libpq says, without the password and on one line.
  std::string said(const std::exception& exception) const {
    std::string text = exception.what();
    const std::string& password = address_.password;
    for (std::size_t at = password.empty() ? std::string::npos : text.find(password);
         at != std::string::npos; at = text.find(password, at + 3)) {
      text.replace(at, password.size(), "***");
    }
    text = text.substr(0, text.find('\n'));
    for (const std::string_view prefix : {"ERROR:", "FATAL:"}) {
      if (text.starts_with(prefix)) {
        text.erase(0, prefix.size());
      }
    }
    text.erase(0, text.find_first_not_of(' '));
    return text;
  }

  Error gone(const std::string& why) const {
    return {ErrorCode::device_unavailable, fmt::format("the store's server is away: {}", why),
            address_.shown, "check that the server runs and can be reached, then run it again"};
  }

  Error connection_error(const std::exception& exception) const {
    const std::string why = said(exception);
    const auto says = [&](std::string_view part) { return why.find(part) != std::string::npos; };
    if (says("password") || says("pg_hba.conf") || says("role \"") || says("authentication")) {
      return {ErrorCode::permission, fmt::format("the store's server refuses: {}", why),
              address_.shown, "check user and password (also PGPASSWORD and ~/.pgpass)"};
    }
    if (says("database \"") && says("does not exist")) {
      return {ErrorCode::no_input, fmt::format("the store's server answers: {}", why),
              address_.shown, "make it on the server: createdb NAME"};
    }
    return gone(why);
  }

  Error busy(const std::exception& exception) const {
    return {ErrorCode::io, fmt::format("the store answers: {}", said(exception)), address_.shown,
            "another program keeps the store busy; try again"};
  }

  Error sql_error(const pqxx::sql_error& exception) const {
    const std::string what = fmt::format("the store answers: {}", said(exception));
    const std::string state = state_of(exception);
    const std::string& where = address_.shown;
    if (state.starts_with("57P")) {
      return gone(said(exception));
    }
    if (state.starts_with("28") || state == "42501" || state == "25006") {
      return {ErrorCode::permission, what, where,
              "ask the server's administrator for the right to write into this database"};
    }
    if (state.starts_with("53")) {
      return {ErrorCode::io, what, where, "free some space on the server's disk and try again"};
    }
    if (state == "55P03") {
      return busy(exception);
    }
    if (state.starts_with("23") || state == "P0001") {
      return {ErrorCode::bad_data, what, where,
              "the store keeps its history as it is; write a correction instead"};
    }
    if (state.starts_with("22")) {
      return {ErrorCode::bad_data, what, where, "the text or number cannot be stored as it is"};
    }
    if (state.starts_with("XX")) {
      return {ErrorCode::bad_data, what, where,
              "the server finds its own files damaged: keep them, restore the last backup"};
    }
    return {ErrorCode::internal, fmt::format("{} ({})", what, state), where,
            "please report this with the command line"};
  }

  // The seam: nothing that libpqxx throws goes further.
  template <class Work>
  auto guarded(Work&& work) -> decltype(work()) {
    try {
      return work();
    } catch (const pqxx::sql_error& exception) {
      return fail(is_open() ? sql_error(exception) : gone(said(exception)));
    } catch (const pqxx::transaction_rollback& exception) {  // states 40..., no sql_error
      return fail(busy(exception));
    } catch (const pqxx::broken_connection& exception) {
      return fail(connection_ == nullptr ? connection_error(exception) : gone(said(exception)));
    } catch (const std::exception& exception) {
      if (connection_ != nullptr && !connection_->is_open()) {
        return fail(gone(said(exception)));
      }
      return fail(ErrorCode::internal, fmt::format("the store answers: {}", said(exception)),
                  address_.shown, "please report this with the command line");
    }
  }

  PostgresAddress address_;
  std::unique_ptr<pqxx::connection> connection_;
  std::unique_ptr<pqxx::quiet_errorhandler> quiet_;
  std::map<std::string, std::string> prepared_;  // statement -> its name on this connection
  bool in_transaction_ = false;
  int cursors_ = 0;
};

// A cursor on the server.
class PostgresRows final : public RowStream {
 public:
  PostgresRows(PostgresDatabase& database, std::string name)
      : database_(database),
        fetch_(fmt::format("FETCH {} FROM {}", kRowsPerFetch, name)),
        name_(std::move(name)) {}

  Result<bool> next(Row& row) override {
    if (at_ == batch_.size() && !at_end_) {
      SIXPOINT_ASSIGN(batch_, database_.guarded([&] { return database_.answer(fetch_, {}); }));
      at_ = 0;
      at_end_ = batch_.size() < kRowsPerFetch;
    }
    if (at_ == batch_.size()) {
      return false;
    }
    return database_.guarded([&]() -> Result<bool> {
      read_fields(batch_[at_++], row);
      return true;
    });
  }

 private:
  PostgresDatabase& database_;
  std::string fetch_;
  std::string name_;
  pqxx::result batch_;
  pqxx::result::size_type at_ = 0;
  bool at_end_ = false;
};

Result<std::unique_ptr<RowStream>> PostgresDatabase::stream(const std::string& sql,
                                                            std::span<const Value> parameters) {
  // The cursor ends with its transaction.
  const std::string name = fmt::format("sixpoint_rows_{}", ++cursors_);
  SIXPOINT_CHECK(execute(fmt::format("DECLARE {} NO SCROLL CURSOR FOR {}", name, sql), parameters));
  return std::make_unique<PostgresRows>(*this, name);
}

Result<std::unique_ptr<Database>> open(const std::string& location) {
  SIXPOINT_ASSIGN(auto address, parse_postgres_address(location));
  auto database = std::make_unique<PostgresDatabase>(std::move(address));
  SIXPOINT_CHECK(database->connect());
  SIXPOINT_CHECK(database->check_owner());
  return database;
}

}  // namespace
}  // namespace sixpoint::db

extern "C" const sixpoint::db::PostgresPart sixpoint_part_postgres = {&sixpoint::db::open};
