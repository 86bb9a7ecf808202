#include <array>
#include <cerrno>
#include <cstring>
#include <map>

#include <SQLiteCpp/Backup.h>
#include <SQLiteCpp/SQLiteCpp.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include "db/servers/database.h"
#include "db/servers/sqlite_indexes.h"

namespace sixpoint::db {
namespace {

// "sixp" in ASCII: tells our file from any other SQLite file.
constexpr std::int64_t kApplicationId = 0x73697870;
constexpr int kBusyTimeout_ms = 30'000;
// While a store is made SQLite does not wait for another program that makes it too, but says at
// once that it is busy: so it is asked again.
constexpr int kBusyPause_ms = 100;

Error to_error(const SQLite::Exception& exception, const std::string& path) {
  const std::string what = fmt::format("the store answers: {}", exception.what());
  switch (exception.getErrorCode()) {
    case SQLITE_CANTOPEN:
      return {ErrorCode::cannot_create, what, path, "check that the folder exists and is writable"};
    case SQLITE_READONLY:
    case SQLITE_PERM:
    case SQLITE_AUTH:
      return {ErrorCode::permission, what, path,
              "make the file and its folder writable for this user"};
    case SQLITE_NOTADB:
      return {ErrorCode::bad_data, what, path,
              "name a store, or move the file away: what waits in the journal then goes into a new "
              "one; if it was a store, keep it and restore the last backup"};
    case SQLITE_CORRUPT:
      return {
          ErrorCode::bad_data, what, path,
          "keep the damaged file and restore the last backup ('audit verify' on a copy says how "
          "far it can be read)"};
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return {ErrorCode::io, what, path, "another program keeps the store busy; try again"};
    case SQLITE_FULL:
    case SQLITE_IOERR:
      return {ErrorCode::io, what, path,
              "free some space on the disk, or raise the limit of a file's size ('ulimit -f'), and "
              "run the command again"};
    case SQLITE_NOMEM:
      return {ErrorCode::io, what, path, "end other programs, or raise the limit of memory"};
    case SQLITE_CONSTRAINT:
      return {ErrorCode::bad_data, what, path,
              "the store keeps its history as it is; write a correction instead"};
    default:
      return {ErrorCode::internal, what, path, "please report this with the command line"};
  }
}

// The seam: nothing that SQLiteCpp throws goes further.
template <class Work>
auto answered(const std::string& path, const Work& work) -> decltype(work()) {
  try {
    return work();
  } catch (const SQLite::Exception& exception) {
    return fail(to_error(exception, path));
  }
}

void bind(SQLite::Statement& statement, std::span<const Value> parameters) {
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const std::string name = fmt::format("${}", i + 1);
    std::visit(
        [&](const auto& value) {
          using T = std::decay_t<decltype(value)>;
          if constexpr (std::is_same_v<T, std::monostate>) {
            statement.bind(name);
          } else if constexpr (std::is_same_v<T, Bytes>) {
            // A null pointer would be NULL; no bytes are bytes.
            statement.bind(name, value.empty() ? static_cast<const void*>("") : value.data(),
                           static_cast<int>(value.size()));
          } else {
            statement.bind(name, value);
          }
        },
        parameters[i]);
  }
}

// The T in `value`, put there first when it holds something else: its memory is used again.
template <class T>
T& storage(Value& value) {
  if (auto* held = std::get_if<T>(&value)) {
    return *held;
  }
  return value.emplace<T>();
}

void read_row(SQLite::Statement& statement, Row& row) {
  row.resize(static_cast<std::size_t>(statement.getColumnCount()));
  for (int i = 0; i < statement.getColumnCount(); ++i) {
    const SQLite::Column column = statement.getColumn(i);
    Value& value = row[static_cast<std::size_t>(i)];
    switch (column.getType()) {
      case SQLITE_NULL:
        value = std::monostate{};
        break;
      case SQLITE_INTEGER:
        value = static_cast<std::int64_t>(column.getInt64());
        break;
      case SQLITE_BLOB: {
        const auto* begin = static_cast<const std::uint8_t*>(column.getBlob());
        storage<Bytes>(value).assign(begin, begin + column.getBytes());
        break;
      }
      default: {
        const char* begin = column.getText();
        storage<std::string>(value).assign(begin, static_cast<std::size_t>(column.getBytes()));
      }
    }
  }
}

// A compiled statement goes back to its start whether it succeeded or not: one that failed would
// hold its locks and say the same error again at its next use.
class Reset {
 public:
  explicit Reset(SQLite::Statement& statement) : statement_(statement) {}
  Reset(const Reset&) = delete;
  Reset& operator=(const Reset&) = delete;
  ~Reset() { statement_.tryReset(); }

 private:
  SQLite::Statement& statement_;
};

Error not_ours(const std::string& path) {
  return {ErrorCode::bad_data, "the file is an SQLite database, but not a store of sixpoint", path,
          "name another file with --store"};
}

class SqliteRows final : public RowStream {
 public:
  SqliteRows(SQLite::Database& database, const std::string& sql, std::span<const Value> parameters,
             std::string path)
      : statement_(database, sql), path_(std::move(path)) {
    bind(statement_, parameters);
  }
  Result<bool> next(Row& row) override {
    return answered(path_, [&]() -> Result<bool> {
      if (!statement_.executeStep()) {
        return false;
      }
      read_row(statement_, row);
      return true;
    });
  }

 private:
  SQLite::Statement statement_;
  std::string path_;
};

// `path` as SQLite reads it in an address, whatever bytes it has; a file also where it is
// ":memory:". Two slashes say that no host follows, for a path may begin with two itself.
std::string address_of(const std::string& path, std::string_view setting) {
  std::string address = path.starts_with('/') ? "file://" : "file:./";
  for (const char c : path) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '/' || c == '.' || c == '-' || c == '_';
    address += plain ? std::string(1, c) : fmt::format("%{:02x}", static_cast<unsigned char>(c));
  }
  return address + "?" + std::string(setting);
}

Status make_private_file(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, S_IRUSR | S_IWUSR);
  // Another process may have made it meanwhile.
  if (file >= 0) {
    ::close(file);
    return {};
  }
  if (errno == EEXIST && ::access(path.c_str(), F_OK) == 0) {
    return {};
  }
  return fail(errno == EACCES || errno == EROFS ? ErrorCode::permission : ErrorCode::cannot_create,
              fmt::format("the store cannot be made: {}", std::strerror(errno)), path,
              "check that the folder exists and is writable");
}

class SqliteDatabase final : public Database {
 public:
  // A file, whatever its name is.
  explicit SqliteDatabase(const std::string& path)
      : database_(address_of(path, "mode=rw"), SQLite::OPEN_READWRITE | SQLite::OPEN_URI,
                  kBusyTimeout_ms),
        path_(path) {}
  // No file.
  SqliteDatabase() : database_(":memory:", SQLite::OPEN_READWRITE), path_(":memory:") {}
  // Only to read; `setting`: how SQLite reads the file.
  SqliteDatabase(const std::string& path, const char* setting)
      : database_(address_of(path, setting), SQLite::OPEN_READONLY | SQLite::OPEN_URI,
                  kBusyTimeout_ms),
        path_(path),
        setting_to_read_(setting) {}

  Status prepare() {
    const auto read_only = [&](const std::string& what) {
      return fail(ErrorCode::permission, what, path_,
                  "make the file and its folder writable for this user; a store on a read-only "
                  "disk is read from a copy elsewhere");
    };
    if (sqlite3_db_readonly(database_.getHandle(), "main") == 1) {
      return read_only("the store may only be read here");
    }
    for (int waited_ms = 0;; waited_ms += kBusyPause_ms) {
      try {
        database_.setBusyTimeout(kBusyPause_ms);
        SIXPOINT_CHECK(take_if_empty());
        database_.exec("PRAGMA journal_mode=WAL");
        database_.exec("PRAGMA synchronous=FULL");
        set_up_connection();
        database_.setBusyTimeout(kBusyTimeout_ms);
        return {};
      } catch (const SQLite::Exception& exception) {
        // The file itself was opened: it is the files beside it that cannot be made.
        if (exception.getErrorCode() == SQLITE_CANTOPEN) {
          return read_only("nothing can be written beside the store");
        }
        if (exception.getErrorCode() != SQLITE_BUSY || waited_ms >= kBusyTimeout_ms) {
          return fail(to_error(exception, path_));
        }
      }
      sqlite3_sleep(kBusyPause_ms);
    }
  }

  // For a connection that only reads; the first read shows whether it can.
  void prepare_to_read() {
    set_up_connection();
    static_cast<void>(database_.execAndGet("SELECT count(*) FROM sqlite_schema").getInt64());
  }

  void set_up_connection() {
    database_.exec("PRAGMA foreign_keys=ON");
    // Views and triggers of a file from elsewhere must not run functions of ours.
    database_.exec("PRAGMA trusted_schema=OFF");
  }

  // An empty file gets our mark before anything else, and before WAL mode: then the mark stands in
  // the file itself, where look_at() finds it whatever happens next.
  Status take_if_empty() {
    // In this order: another program that makes the store now sets the mark before it makes tables.
    const bool empty = database_.execAndGet("SELECT count(*) FROM sqlite_schema").getInt() == 0;
    const std::int64_t id = database_.execAndGet("PRAGMA application_id").getInt64();
    if (id == kApplicationId) {
      return {};
    }
    if (id != 0 || !empty) {
      return fail(not_ours(path_));
    }
    database_.exec("PRAGMA synchronous=FULL");
    database_.exec(fmt::format("PRAGMA application_id={}", kApplicationId));
    return {};
  }

  Status begin_writing() override {
    SIXPOINT_CHECK(has_its_name());
    return run("BEGIN IMMEDIATE");
  }
  Status begin_reading() override {
    SIXPOINT_CHECK(run("BEGIN"));
    // The snapshot is taken by the first reading statement, so read something now.
    SIXPOINT_CHECK(query("SELECT count(*) FROM sqlite_schema", {}));
    return {};
  }
  // What is written into a file without a name is lost, or in another place than people look.
  Status commit() override {
    SIXPOINT_CHECK(run("COMMIT"));
    return has_its_name();
  }
  void roll_back() override {
    if (sqlite3_get_autocommit(database_.getHandle()) == 0) {
      static_cast<void>(run("ROLLBACK"));
    }
  }

  Status has_its_name() {
    int is_moved = 0;
    sqlite3_file_control(database_.getHandle(), "main", SQLITE_FCNTL_HAS_MOVED, &is_moved);
    return is_moved == 0 ? Status()
                         : fail(ErrorCode::io, "the store's file was moved or removed meanwhile",
                                path_, "put it back, then 'sixpoint store catch-up'");
  }

  Status execute(const std::string& sql, std::span<const Value> parameters) override {
    SIXPOINT_CHECK(query(sql, parameters));
    return {};
  }

  Result<std::unique_ptr<RowStream>> stream(const std::string& sql,
                                            std::span<const Value> parameters) override {
    return answered(path_, [&]() -> Result<std::unique_ptr<RowStream>> {
      return std::make_unique<SqliteRows>(database_, sql, parameters, path_);
    });
  }

  Result<std::vector<Row>> query(const std::string& sql,
                                 std::span<const Value> parameters) override {
    return answered(path_, [&]() -> Result<std::vector<Row>> {
      auto& statement = prepared(sql);
      const Reset reset(statement);
      bind(statement, parameters);
      std::vector<Row> rows;
      while (statement.executeStep()) {
        read_row(statement, rows.emplace_back());
      }
      return rows;
    });
  }

  Result<std::vector<std::string>> check_indexes() override {
    const char* file = sqlite3_db_filename(database_.getHandle(), "main");
    if (file == nullptr || *file == '\0') {
      return std::vector<std::string>();  // in memory: nothing that a second connection could read
    }
    return answered(path_, [&]() -> Result<std::vector<std::string>> {
      SQLite::Database own(address_of(path_, setting_to_read_),
                           SQLite::OPEN_READONLY | SQLite::OPEN_URI, kBusyTimeout_ms);
      own.exec("BEGIN");
      return check_sqlite_indexes(*own.getHandle());
    });
  }

  Result<bool> copy_to_file(const std::string& path) override {
    SIXPOINT_CHECK(make_private_file(path));
    return answered(path, [&]() -> Result<bool> {
      SQLite::Database copy(address_of(path, "mode=rwc"),
                            SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_URI,
                            kBusyTimeout_ms);
      copy.exec("PRAGMA synchronous=FULL");
      SQLite::Backup backup(copy, database_);
      // In one step: a copy in many steps begins again whenever another process writes.
      backup.executeStep(-1);
      return true;
    });
  }

  Result<std::int64_t> schema_version() override {
    SIXPOINT_ASSIGN(const auto rows, query("PRAGMA user_version", {}));
    return integer_of(rows[0][0]);
  }

  Status set_schema_version(std::int64_t version) override {
    return run(fmt::format("PRAGMA user_version={}", version));
  }

  std::vector<std::string> append_only_statements(const std::string& table) const override {
    std::vector<std::string> statements;
    for (const std::string change : {"UPDATE", "DELETE"}) {
      statements.push_back(fmt::format(
          "CREATE TRIGGER {0}_no_{1} BEFORE {1} ON {0} BEGIN "
          "SELECT RAISE(ABORT, 'history never changes: write a correction instead'); END",
          table, change));
    }
    return statements;
  }
  std::string blob_type() const override { return "BLOB"; }
  std::string integer_type() const override { return "INTEGER"; }
  std::string table_options() const override { return " STRICT"; }
  const std::string& location() const override { return path_; }

 private:
  Status run(const std::string& sql) {
    return answered(path_, [&]() -> Status {
      database_.exec(sql);
      return {};
    });
  }

  // The store has a few dozen statements; each is compiled once.
  SQLite::Statement& prepared(const std::string& sql) {
    const auto found = prepared_.find(sql);
    if (found != prepared_.end()) {
      return *found->second;
    }
    return *prepared_.emplace(sql, std::make_unique<SQLite::Statement>(database_, sql))
                .first->second;
  }

  SQLite::Database database_;
  std::map<std::string, std::unique_ptr<SQLite::Statement>> prepared_;
  std::string path_;
  const char* setting_to_read_ = "mode=ro";  // of a second connection
};

enum class Found { nothing, empty, ours };

bool has_bytes(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 && status.st_size > 0;
}

// Our mark in the file's first bytes. SQLite does not answer for a file that a full disk left half
// copied from its log; with the log it is whole.
bool has_our_mark(SQLite::Database& database) {
  constexpr std::size_t kMarkAt = 68;
  std::array<std::uint8_t, 100> header{};
  sqlite3_file* file = nullptr;
  sqlite3_file_control(database.getHandle(), "main", SQLITE_FCNTL_FILE_POINTER, &file);
  if (file == nullptr || file->pMethods == nullptr ||
      file->pMethods->xRead(file, header.data(), static_cast<int>(header.size()), 0) != SQLITE_OK) {
    return false;
  }
  std::int64_t mark = 0;
  for (std::size_t i = kMarkAt; i < kMarkAt + 4; ++i) {
    mark = mark * 256 + header[i];
  }
  return std::memcmp(header.data(), "SQLite format 3", 16) == 0 && mark == kApplicationId;
}

// What SQLite sees in the file alone, without a lock and without a file beside it. Opening the file
// by other means would, at its close, end the locks of this process's other connections.
Result<Found> look_at_database(const std::string& path) {
  auto found = answered(path, [&]() -> Result<Found> {
    SQLite::Database looked(address_of(path, "immutable=1"),
                            SQLite::OPEN_READONLY | SQLite::OPEN_URI);
    if (has_our_mark(looked)) {
      return Found::ours;
    }
    const bool empty = looked.execAndGet("SELECT count(*) FROM sqlite_schema").getInt64() == 0;
    const std::int64_t id = looked.execAndGet("PRAGMA application_id").getInt64();
    if (id == kApplicationId) {
      return Found::ours;  // made at this moment
    }
    if (id != 0 || !empty) {
      return fail(not_ours(path));
    }
    if (!has_bytes(path + "-wal")) {
      return Found::empty;
    }
    // All that was written so far is in a log; a reader beside its writers changes neither.
    if (::access((path + "-shm").c_str(), F_OK) == 0) {
      SQLite::Database with_log(address_of(path, "mode=ro"),
                                SQLite::OPEN_READONLY | SQLite::OPEN_URI);
      if (with_log.execAndGet("PRAGMA application_id").getInt64() == kApplicationId) {
        return Found::ours;
      }
    }
    return fail(not_ours(path));
  });
  if (!found && ::access(path.c_str(), R_OK) != 0) {
    return fail(ErrorCode::permission, "the store may not be read by this user", path,
                "ask its owner: a store is its owner's alone (mode 0600)");
  }
  return found;
}

Result<Found> look_at(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) {
    if (errno == ELOOP) {
      return fail(ErrorCode::cannot_create, "the store is a symbolic link in a circle", path,
                  "name another file with --store");
    }
    return Found::nothing;
  }
  if (!S_ISREG(status.st_mode)) {
    return fail(ErrorCode::bad_data,
                S_ISDIR(status.st_mode) ? "the store is a folder" : "the store is no regular file",
                path, "name a file with --store");
  }
  return status.st_size == 0 ? Found::empty : look_at_database(path);
}

// A store that no one has open stands whole in its file, and is read as it stands: SQLite would
// make files beside it that its owner could not use. Where there is a log, SQLite reads both.
Result<std::unique_ptr<Database>> open_to_read(const std::string& path) {
  const bool has_log = ::access((path + "-wal").c_str(), F_OK) == 0;
  auto opened = answered(path, [&]() -> Result<std::unique_ptr<Database>> {
    auto database = std::make_unique<SqliteDatabase>(path, has_log ? "mode=ro" : "immutable=1");
    database->prepare_to_read();
    return database;
  });
  // The file itself was read before: it is the one beside it that cannot be opened.
  if (!opened && opened.error().code == ErrorCode::cannot_create && has_log) {
    return fail(ErrorCode::permission,
                "what was written last is in a file beside the store that may not be used here",
                path, "ask its owner to open it once, for example with 'sixpoint units'");
  }
  return opened;
}

}  // namespace

Result<std::unique_ptr<Database>> open_sqlite_in_memory() {
  return answered("memory", []() -> Result<std::unique_ptr<Database>> {
    auto database = std::make_unique<SqliteDatabase>();
    SIXPOINT_CHECK(database->prepare());
    return database;
  });
}

Result<std::unique_ptr<Database>> open_sqlite(const std::string& path, Access access) {
  SIXPOINT_ASSIGN(const Found found, look_at(path));
  if (access == Access::read) {
    if (found == Found::nothing) {
      return fail(ErrorCode::no_input, "there is no store", path, "check the path");
    }
    if (found == Found::empty) {
      return fail(ErrorCode::bad_data, "this file is empty and no store", path,
                  "name another file with --store");
    }
    return open_to_read(path);
  }
  if (found == Found::nothing) {
    SIXPOINT_CHECK(make_private_file(path));
  }
  return answered(path, [&]() -> Result<std::unique_ptr<Database>> {
    auto database = std::make_unique<SqliteDatabase>(path);
    SIXPOINT_CHECK(database->prepare());
    return database;
  });
}

}  // namespace sixpoint::db
