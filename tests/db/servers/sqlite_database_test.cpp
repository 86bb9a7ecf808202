// What only a store in a file can meet: other files, no rights, full disks, damage, early versions.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <future>
#include <latch>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/memory_env.h"
#include "base/random.h"
#include "db/exchange.h"
#include "db/schema.h"
#include "db/store.h"
#include "expect_result.h"
#include "temporary_folder.h"

namespace sixpoint::db {
namespace {

class SqliteStoreTest : public testing::Test {
 protected:
  Result<Store> open() { return Store::open(memory_.env, path()); }
  std::string path() const { return folder_ / "store.db"; }
  static ConstantsRecord constants(std::int64_t time_s) {
    ConstantsRecord record;
    record.made_at = from_unix_seconds(time_s);
    record.serial = "MOS2A1";
    record.filter = "current";
    record.method = "jig";
    record.document = R"({"n":)" + std::to_string(time_s) + "}";
    return record;
  }
  void run_sql(const std::string& sql) const {
    sqlite3* handle = nullptr;
    ASSERT_EQ(sqlite3_open(path().c_str(), &handle), SQLITE_OK);
    char* message = nullptr;
    ASSERT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, &message), SQLITE_OK) << message;
    sqlite3_close(handle);
  }

  sixpoint::tests::TemporaryFolder folder_;
  MemoryEnv memory_;
};

// What another program may do to a store: nothing is acknowledged then that is not kept.
TEST_F(SqliteStoreTest, AStoreWithTablesOfAnotherProgramTakesNothing) {
  for (const char* change :
       {"PRAGMA ignore_check_constraints=ON; UPDATE head SET one = 2",
        "CREATE TRIGGER t BEFORE UPDATE ON head BEGIN SELECT RAISE(IGNORE); END",
        "CREATE TRIGGER t BEFORE INSERT ON constants BEGIN SELECT RAISE(IGNORE); END"}) {
    std::filesystem::remove(path());
    {
      auto store = open();
      ASSERT_OK(store);
      ASSERT_OK(store->add_constants(constants(1), "w"));
    }
    run_sql(change);
    auto store = open();
    ASSERT_OK(store);
    SCOPED_TRACE(change);
    EXPECT_FAILS(store->add_constants(constants(2), "w"), ErrorCode::bad_data);
    EXPECT_EQ(store->history("MOS2A1")->size(), 1U) << "nothing of it is there";
  }
}

TEST_F(SqliteStoreTest, AVersionThatItsTablesContradictIsBadData) {
  ASSERT_OK(open());
  for (const char* version : {"0", "1", "2"}) {
    run_sql(std::string("PRAGMA user_version=") + version);
    SCOPED_TRACE(version);
    EXPECT_FAILS(open(), ErrorCode::bad_data);
  }
}

TEST_F(SqliteStoreTest, ABackupIsItsOwnersAlone) {
  auto store = open();
  ASSERT_OK(store);
  const mode_t before = ::umask(0);
  const auto made = backup(*store, posix_env(), folder_ / "copy.db");
  ::umask(before);
  ASSERT_OK(made);
  struct stat status {};
  ASSERT_EQ(::stat((folder_ / "copy.db").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
}

// In an address the word behind two slashes would be a host.
TEST_F(SqliteStoreTest, APathMayBeginWithTwoSlashes) {
  ASSERT_OK(Store::open(memory_.env, "/" + path()));
  EXPECT_TRUE(std::filesystem::exists(path()));
  ASSERT_OK(Store::open(memory_.env, "/" + path())) << "once more, now that it is there";
}

// A station opens its store from several threads, and two stations may begin at the same moment.
TEST_F(SqliteStoreTest, ThoseThatMakeAStoreAtOnceAllHaveIt) {
  for (int round = 0; round < 25; ++round) {
    const std::string name = folder_ / ("new" + std::to_string(round) + ".db");
    std::latch together(4);
    std::vector<std::future<Status>> made;
    for (int i = 0; i < 4; ++i) {
      made.push_back(std::async(std::launch::async, [&]() -> Status {
        together.arrive_and_wait();
        SIXPOINT_ASSIGN(auto store, Store::open(posix_env(), name));
        return store.station_events() ? Status() : fail(ErrorCode::io, "it cannot be read");
      }));
    }
    for (auto& each : made) {
      const Status status = each.get();
      EXPECT_OK(status);
    }
  }
}

TEST_F(SqliteStoreTest, OpensOnlyStores) {
  std::ofstream(path()) << "this is a text file, long enough to be looked at as a database header "
                           "of one hundred bytes and more";
  const auto text_file = open();
  EXPECT_FAILS(text_file, ErrorCode::bad_data);
  EXPECT_THAT(text_file.error().hint, testing::HasSubstr("name a store"));
  EXPECT_FAILS(Store::open(memory_.env, folder_ / "none/store.db"), ErrorCode::cannot_create);
  const std::string other = folder_ / "other.db";
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(other.c_str(), &handle), SQLITE_OK);
  sqlite3_exec(handle, "CREATE TABLE mine (a)", nullptr, nullptr, nullptr);
  sqlite3_close(handle);
  EXPECT_FAILS(Store::open(memory_.env, other), ErrorCode::bad_data);
  ASSERT_OK(open_sqlite(folder_ / "newer.db").value()->set_schema_version(99));
  EXPECT_FAILS(Store::open(memory_.env, folder_ / "newer.db"), ErrorCode::configuration);
}

std::string all_bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<std::string> names_in(const std::string& folder) {
  return posix_env().files.list(folder).value();
}

unsigned mode_of(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 ? status.st_mode & 07777U : 0U;
}

// The rows of open_sqlite()'s table that refuse a file: bytes and neighbours stay.
TEST_F(SqliteStoreTest, LeavesAStrangersFileAsItIs) {
  const std::string other = folder_ / "other.db";
  for (const char* mode : {"DELETE", "WAL"}) {
    std::filesystem::remove(other);
    sqlite3* handle = nullptr;
    ASSERT_EQ(sqlite3_open(other.c_str(), &handle), SQLITE_OK);
    const std::string sql = std::string("PRAGMA journal_mode=") + mode +
                            "; CREATE TABLE mine (a); INSERT INTO mine VALUES (1)";
    ASSERT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
    const auto refuse = [&] {
      const std::string before = all_bytes(other);
      const auto names = names_in(folder_.path());
      EXPECT_FAILS(Store::open(memory_.env, other), ErrorCode::bad_data);
      EXPECT_FAILS(Store::open_to_read(memory_.env, other), ErrorCode::bad_data);
      EXPECT_EQ(all_bytes(other), before) << mode;
      EXPECT_EQ(names_in(folder_.path()), names) << mode;
    };
    refuse();  // while the other program has it open: in WAL mode the file itself is still empty
    ASSERT_EQ(sqlite3_exec(handle, "INSERT INTO mine VALUES (2)", nullptr, nullptr, nullptr),
              SQLITE_OK)
        << "the other program works on";
    sqlite3_close(handle);
    refuse();
  }
}

// As earlier programs made a store: their mark stands in the log until it is copied.
TEST_F(SqliteStoreTest, KnowsAStoreWhoseMarkIsInItsLog) {
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(path().c_str(), &handle), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(handle, "PRAGMA journal_mode=WAL; PRAGMA application_id=0x73697870",
                         nullptr, nullptr, nullptr),
            SQLITE_OK);
  EXPECT_OK(open());
  sqlite3_close(handle);
  EXPECT_OK(open());
}

TEST_F(SqliteStoreTest, AFolderALoopAndAPipeAreNoStores) {
  std::filesystem::create_directory(folder_ / "folder");
  std::filesystem::create_symlink("loop", folder_ / "loop");
  std::filesystem::create_symlink("none", folder_ / "lost");
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_FAILS(Store::open(memory_.env, folder_ / "folder"), ErrorCode::bad_data);
  EXPECT_FAILS(Store::open(memory_.env, folder_ / "loop"), ErrorCode::cannot_create);
  EXPECT_FAILS(Store::open(memory_.env, folder_ / "lost"), ErrorCode::cannot_create);
  EXPECT_FAILS(Store::open(memory_.env, folder_ / "pipe"), ErrorCode::bad_data);
  EXPECT_FAILS(Store::open_to_read(memory_.env, folder_ / "none.db"), ErrorCode::no_input);
  std::ofstream(folder_ / "empty.db").flush();
  EXPECT_FAILS(Store::open_to_read(memory_.env, folder_ / "empty.db"), ErrorCode::bad_data);
  EXPECT_EQ(std::filesystem::file_size(folder_ / "empty.db"), 0U);
  ASSERT_OK(Store::open(memory_.env, folder_ / "empty.db"));
  EXPECT_EQ(names_in(folder_.path()),
            (std::vector<std::string>{"empty.db", "folder", "loop", "lost", "pipe"}));
}

TEST_F(SqliteStoreTest, AStoreIsItsOwnersAlone) {
  auto store = open();
  ASSERT_OK(store);
  ASSERT_OK(store->add_constants(constants(1), "w"));
  for (const char* name : {"store.db", "store.db-wal", "store.db-shm"}) {
    EXPECT_EQ(mode_of(folder_ / name), 0600U) << name;
  }
}

TEST_F(SqliteStoreTest, TakesNamesInAnyEncoding) {
  for (const std::string name : {"caf\xe9.db", "\xff\xfe?#%20&.db", "a b\n.db"}) {
    const std::string place = folder_ / name;
    {
      auto store = Store::open(memory_.env, place);
      ASSERT_OK(store);
      ASSERT_OK(store->add_constants(constants(1), "w"));
    }
    ASSERT_TRUE(std::filesystem::exists(place));
    auto again = Store::open_to_read(memory_.env, place);
    ASSERT_OK(again);
    EXPECT_EQ(again->history("MOS2A1")->size(), 1U);
  }
  EXPECT_EQ(names_in(folder_.path()).size(), 3U);
}

// SQLite would keep a database of this name in memory, and lose it.
TEST_F(SqliteStoreTest, TheNameOfAStoreIsAlwaysThatOfAFile) {
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder_.path());
  auto store = Store::open(memory_.env, ":memory:");
  EXPECT_OK(store);
  if (store) {
    EXPECT_OK(store->add_constants(constants(1), "w"));
    store = Store::open(memory_.env, ":memory:");
  }
  std::filesystem::current_path(before);
  ASSERT_OK(store);
  EXPECT_EQ(store->history("MOS2A1")->size(), 1U);
}

// The index of constants loses its entry for the newest set, behind SQLite's back: the chain of the
// rows holds, and the question "which constants apply" would be answered wrongly.
TEST_F(SqliteStoreTest, AuditFindsAnIndexThatDoesNotSayWhatItsTableSays) {
  {
    auto store = open();
    for (int i = 1; i <= 5; ++i) {
      ASSERT_OK(store->add_constants(constants(i), "w"));
    }
    EXPECT_TRUE(store->audit()->ok);
  }
  run_sql(
      "DROP TRIGGER constants_no_update; PRAGMA foreign_keys=OFF;"
      "UPDATE constants SET serial='X' WHERE made_at_ns=5000000000");
  run_sql(
      "CREATE TABLE aside AS SELECT * FROM sqlite_schema WHERE name='constants_by_1';"
      "PRAGMA writable_schema=ON; DELETE FROM sqlite_schema WHERE name='constants_by_1'");
  run_sql("UPDATE constants SET serial='MOS2A1' WHERE made_at_ns=5000000000");
  run_sql("PRAGMA writable_schema=ON; INSERT INTO sqlite_schema SELECT * FROM aside");
  run_sql("DROP TABLE aside");
  auto store = open();
  ASSERT_OK(store);
  EXPECT_EQ(store->constants_history("MOS2A1").value().constants.back().made_at,
            from_unix_seconds(4))
      << "the wrong answer that the audit has to find";
  const auto audit = store->audit();
  ASSERT_OK(audit);
  EXPECT_FALSE(audit->ok);
  std::string all;
  for (const std::string& finding : audit->findings) {
    all += finding + "\n";
  }
  EXPECT_NE(all.find("constants_by_1 of constants does not say"), std::string::npos) << all;
  EXPECT_EQ(audit->findings.size(), 1U) << all;
  EXPECT_EQ(all.find("does not fit the chain"), std::string::npos) << all;
}

// The text of version 1, as the first program wrote it, with three rows and their hashes. The
// hashes were computed by another program (Python's hashlib) from the description in docs/store.md.
TEST_F(SqliteStoreTest, BringsAStoreOfVersion1UpToDateAndItsHashesHold) {
  run_sql(
#include "db/store_version_1.sql.inc"
  );
  const auto before =
      std::string("74f4943fa1dd97ddebe9c81a3d40776ef9b0ee4af156aa10d9e7766429e3d57d");
  const auto reads_early = Store::open_to_read(memory_.env, path());
  EXPECT_FAILS(reads_early, ErrorCode::configuration);
  EXPECT_THAT(reads_early.error().what, testing::HasSubstr("version 1"));
  EXPECT_EQ(reads_early.error().where, path());
  auto store = open();
  ASSERT_OK(store);
  auto audit = store->audit();
  ASSERT_OK(audit);
  EXPECT_TRUE(audit->ok) << audit->brief();
  EXPECT_EQ(audit->rows, 3);
  EXPECT_EQ(audit->head, before);
  EXPECT_EQ(store->constants_history("MOS2A1")->constants.front().document, R"({"n":1})");
  ASSERT_OK(store->add_constants(constants(7), "w"));
  audit = store->audit();
  EXPECT_TRUE(audit->ok) << audit->brief();
  EXPECT_EQ(audit->rows, 5) << "and the filter configuration, and the constants";
  EXPECT_OK(Store::open_to_read(memory_.env, path())) << "who only reads can do so now";
  EXPECT_TRUE(open()->audit()->ok);
}

TEST_F(SqliteStoreTest, BringsAStoreOfVersion2UpToDateAndItsHashesHold) {
  run_sql(
#include "db/store_version_2.sql.inc"
  );
  auto store = open();
  ASSERT_OK(store);
  const auto audit = store->audit();
  ASSERT_OK(audit);
  EXPECT_TRUE(audit->ok) << audit->brief();
  EXPECT_EQ(audit->rows, 5);
  EXPECT_EQ(audit->head, "b88f65e21c3f51132480dc74ef7f68d9c281037c02b63880f9e4a018855351dd");
  const auto history = store->unit_history("MOS2A1");
  EXPECT_EQ(history->runs.front().build, "e21f353");
  EXPECT_EQ(history->repairs.front().input, "O'Hara.gt3x");
  EXPECT_EQ(store->database().schema_version().value(), kSchemaVersion);
  ASSERT_OK(store->add_constants(constants(7), "w"));
  EXPECT_TRUE(open()->audit()->ok);
}

TEST_F(SqliteStoreTest, ADamagedPageIsNamedAndNothingCrashes) {
  {
    auto store = open();
    for (int i = 0; i < 300; ++i) {
      ASSERT_OK(store->add_constants(constants(i), "w"));
    }
  }
  std::ifstream whole(path(), std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(whole), {}};
  ASSERT_GT(bytes.size(), 8U * 4096);
  std::size_t noticed = 0;
  std::size_t unread = 0;
  std::size_t pages = 0;
  for (std::size_t page = 1; page < bytes.size() / 4096; ++page) {
    std::string damaged = bytes;
    for (std::size_t i = 0; i < 4096; i += 3) {
      damaged[page * 4096 + i] = static_cast<char>(damaged[page * 4096 + i] ^ 0x5A);
    }
    std::ofstream(path(), std::ios::binary) << damaged;
    auto store = open();
    if (!store) {
      EXPECT_EQ(store.error().code, ErrorCode::bad_data) << store.error().brief();
      ++noticed;
    } else {
      const auto audit = store->audit();  // what it cannot read is a finding
      ASSERT_OK(audit);
      noticed += audit->ok ? 0 : 1;
      unread += std::ranges::any_of(audit->findings, [](const std::string& finding) {
        return finding.find("what follows row ") != std::string::npos &&
               finding.find("cannot be read") != std::string::npos;
      });
    }
    ++pages;
  }
  // Pages that hold no row of the history (indexes, the free list) may go unnoticed by the audit.
  EXPECT_GE(noticed, pages / 3);
  EXPECT_GT(unread, 0U);
}

TEST_F(SqliteStoreTest, AFullDiskLosesNothingThatWasAcknowledged) {
  constexpr int kMost = 3000;
  { ASSERT_OK(open()); }
  int pipe_ends[2];
  ASSERT_EQ(::pipe(pipe_ends), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    // No file of this process grows beyond 400 kB: the disk is full from then on.
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{400'000, 400'000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    auto store = open();
    int acknowledged = 0;
    for (; store && acknowledged < kMost; ++acknowledged) {
      const auto id = store->add_constants(constants(acknowledged), "w");
      if (!id) {
        const auto code = static_cast<char>(id.error().code);
        static_cast<void>(!::write(pipe_ends[1], &code, 1));
        static_cast<void>(!::write(pipe_ends[1], &acknowledged, sizeof acknowledged));
        break;
      }
    }
    ::_exit(0);
  }
  ::close(pipe_ends[1]);
  char code = 0;
  int acknowledged = 0;
  ASSERT_EQ(::read(pipe_ends[0], &code, 1), 1);
  ASSERT_EQ(::read(pipe_ends[0], &acknowledged, sizeof acknowledged),
            static_cast<ssize_t>(sizeof acknowledged));
  ::close(pipe_ends[0]);
  ::waitpid(child, nullptr, 0);
  EXPECT_EQ(code, static_cast<char>(ErrorCode::io));
  EXPECT_GT(acknowledged, 10);
  auto store = open();
  ASSERT_OK(store);
  EXPECT_EQ(store->history("MOS2A1")->size(), static_cast<std::size_t>(acknowledged));
  EXPECT_TRUE(store->audit()->ok);
}

TEST_F(SqliteStoreTest, AFileThatMayNotBeWrittenIsReadOnlyWithAClearError) {
  { ASSERT_OK(open()->add_constants(constants(1), "w")); }
  ASSERT_EQ(::chmod(path().c_str(), 0444), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    // Root may write everywhere: be an ordinary user.
    if (::geteuid() == 0 && (::chmod(folder_.path().c_str(), 0555) != 0 || ::setuid(65534) != 0)) {
      ::_exit(100);
    }
    auto store = open();
    if (!store) {
      ::_exit(static_cast<int>(store.error().code));
    }
    const auto id = store->add_constants(constants(2), "w");
    ::_exit(id ? 0 : static_cast<int>(id.error().code));
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), static_cast<int>(ErrorCode::permission));
  // To read it is open all the same, in a folder that may not be written either.
  const pid_t reader = ::fork();
  if (reader == 0) {
    if (::geteuid() == 0 && (::chmod(folder_.path().c_str(), 0555) != 0 || ::setuid(65534) != 0)) {
      ::_exit(100);
    }
    auto store = Store::open_to_read(memory_.env, path());
    const bool reads = store && store->history("MOS2A1")->size() == 1 && store->audit()->ok;
    const auto id = reads ? store->add_constants(constants(2), "w")
                          : Result<std::string>(fail(ErrorCode::internal, "cannot be read"));
    ::_exit(id ? 0 : static_cast<int>(id.error().code));
  }
  ::waitpid(reader, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), static_cast<int>(ErrorCode::permission)) << "reads, never writes";
  ::chmod(folder_.path().c_str(), 0755);
  EXPECT_EQ(open()->history("MOS2A1")->size(), 1U);
}

// Root may read and write everything: until its end this process is an ordinary user.
class AsOrdinaryUser {
 public:
  AsOrdinaryUser() {
    if (was_root_ && ::setresuid(kNobody, kNobody, 0) != 0) {
      throw std::runtime_error("cannot become an ordinary user");
    }
  }
  AsOrdinaryUser(const AsOrdinaryUser&) = delete;
  AsOrdinaryUser& operator=(const AsOrdinaryUser&) = delete;
  ~AsOrdinaryUser() {
    // The kernel forbids to look into a process that changed its user; the leak check does so.
    if (was_root_ && (::setresuid(0, 0, 0) != 0 || ::prctl(PR_SET_DUMPABLE, 1) != 0)) {
      std::abort();
    }
  }

 private:
  static constexpr uid_t kNobody = 65534;
  bool was_root_ = ::geteuid() == 0;
};

// What a user without rights is told. Empty: the store opens.
TEST_F(SqliteStoreTest, SaysWhichRightIsMissing) {
  const struct {
    const char* name;
    mode_t file;
    mode_t log;
    mode_t folder;
    const char* to_write;
    const char* to_read;
  } cases[] = {
      {"store.db", 0444, 0444, 0755, "the store may only be read here", ""},
      {"store.db", 0666, 0444, 0555, "the store answers: attempt to write a readonly database", ""},
      {"store.db", 0, 0444, 0555, "the store may not be read by this user",
       "the store may not be read by this user"},
      {"none.db", 0, 0, 0555, "the store cannot be made: Permission denied", "there is no store"},
      // Its owner has it open, and what was written last is in the log.
      {"open.db", 0444, 0, 0555, "the store may only be read here",
       "what was written last is in a file beside the store"},
      {"open.db", 0666, 0, 0555, "nothing can be written beside the store",
       "what was written last is in a file beside the store"},
  };
  { ASSERT_OK(open()->add_constants(constants(1), "w")); }
  {
    const sixpoint::tests::TemporaryFolder owners;
    auto store = Store::open(memory_.env, owners / "store.db");
    ASSERT_OK(store);
    ASSERT_OK(store->add_constants(constants(1), "w"));
    std::filesystem::copy_file(owners / "store.db", folder_ / "open.db");
    std::filesystem::copy_file(owners / "store.db-wal", folder_ / "open.db-wal");
  }
  for (const auto& each : cases) {
    const std::string place = folder_ / each.name;
    SCOPED_TRACE(place + ", " + each.to_write);
    ::chmod(place.c_str(), each.file);
    ::chmod((place + "-wal").c_str(), each.log);
    ::chmod(folder_.path().c_str(), each.folder);
    const auto names = names_in(folder_.path());
    {
      const AsOrdinaryUser user;
      const auto writes = Store::open(memory_.env, place);
      EXPECT_FAILS(writes, ErrorCode::permission);
      EXPECT_THAT(writes.error().what, testing::StartsWith(each.to_write));
      EXPECT_EQ(writes.error().where, place);
      auto reads = Store::open_to_read(memory_.env, place);
      ASSERT_EQ(reads.has_value(), std::string(each.to_read).empty());
      if (reads) {
        EXPECT_EQ(reads->history("MOS2A1")->size(), 1U);
        EXPECT_FAILS(reads->add_constants(constants(2), "w"), ErrorCode::permission);
      } else {
        EXPECT_THAT(reads.error().what, testing::StartsWith(each.to_read));
        EXPECT_EQ(reads.error().where, place);
        EXPECT_FALSE(reads.error().hint.empty());
      }
    }
    EXPECT_EQ(names_in(folder_.path()), names);
    ::chmod(folder_.path().c_str(), 0755);
  }
}

// Until its end no file of this process grows beyond `size_bytes`, as on a disk that is full.
class FullDisk {
 public:
  explicit FullDisk(rlim_t size_bytes) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{size_bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;
  ~FullDisk() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    ::signal(SIGXFSZ, signal_before_);
  }

 private:
  rlimit before_{};
  void (*signal_before_)(int) = ::signal(SIGXFSZ, SIG_IGN);
};

TEST_F(SqliteStoreTest, AfterAFullDiskTheSameStoreGoesOn) {
  auto store = open();
  ASSERT_OK(store);
  const auto add_run = [&](int number) {
    RunRecord run;
    run.serial = "MOS2A1";
    run.filter = "current";
    run.started = from_unix_seconds(number);
    run.document = "{}";
    return store->add_run(run, {{"raw", Bytes(300'000, static_cast<std::uint8_t>(number))}});
  };
  ASSERT_OK(add_run(1));
  {
    const FullDisk full(std::filesystem::file_size(path() + "-wal"));
    const auto refused = add_run(2);
    EXPECT_FAILS(refused, ErrorCode::io);
    EXPECT_EQ(refused.error().where, path());
    EXPECT_THAT(refused.error().hint, testing::HasSubstr("free some space"));
  }
  ASSERT_OK(add_run(3));
  const auto runs = store->unit_history("MOS2A1").value().runs;
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs[1].started, from_unix_seconds(3));
  EXPECT_TRUE(store->audit()->ok);
}

// A writer that would have to forget what it has read: SQLite refuses it without waiting.
TEST_F(SqliteStoreTest, WhereAnotherProgramWroteMeanwhileItSaysThatTheStoreIsBusy) {
  auto reader = open();
  ASSERT_OK(reader);
  ASSERT_OK(reader->database().begin_reading());
  ASSERT_OK(open()->add_constants(constants(1), "w"));
  const auto refused = reader->database().execute("INSERT INTO attachments VALUES ('a', x'00')");
  EXPECT_FAILS(refused, ErrorCode::io);
  EXPECT_THAT(refused.error().hint, testing::HasSubstr("another program keeps the store busy"));
  reader->database().roll_back();
  EXPECT_OK(reader->add_constants(constants(2), "w"));
  EXPECT_EQ(reader->history("MOS2A1")->size(), 2U);
}

// What would be written into it is nowhere, or where nobody looks.
TEST_F(SqliteStoreTest, AStoreWhoseFileLostItsNameTakesNothing) {
  auto store = open();
  ASSERT_OK(store);
  ASSERT_OK(store->add_constants(constants(1), "w"));
  std::filesystem::rename(path(), path() + ".old");
  EXPECT_FAILS(store->add_constants(constants(2), "w"), ErrorCode::io);
  std::filesystem::rename(path() + ".old", path());
  ASSERT_OK(store->add_constants(constants(3), "w")) << "its name is back";
  std::filesystem::remove(path());
  EXPECT_FAILS(store->add_constants(constants(4), "w"), ErrorCode::io);
}

TEST_F(SqliteStoreTest, AStoreWhoseFileWasRemovedIsNotAuditedAsWhole) {
  auto store = open();
  ASSERT_OK(store);
  ASSERT_OK(store->add_constants(constants(1), "w"));
  std::filesystem::remove(path());
  const auto audit = store->audit();
  EXPECT_FAILS(audit, ErrorCode::cannot_create);
  EXPECT_EQ(audit.error().where, path());
}

// Kills a writing child at a random moment, again and again on one file. What the child said is
// stored must be there. SIXPOINT_KILLS sets how often.
TEST_F(SqliteStoreTest, KilledAtRandomMomentsItKeepsEveryAcknowledgedRow) {
  { ASSERT_OK(open()); }
  const char* wanted = std::getenv("SIXPOINT_KILLS");
  const int kills = wanted == nullptr ? 50 : std::atoi(wanted);
  Random random(5);
  int next = 0;
  for (int kill = 0; kill < kills; ++kill) {
    int pipe_ends[2];
    ASSERT_EQ(::pipe(pipe_ends), 0);
    const pid_t child = ::fork();
    if (child == 0) {
      auto store = open();
      for (int i = next; store; ++i) {
        if (!store->add_constants(constants(i), "w") ||
            ::write(pipe_ends[1], &i, sizeof i) != static_cast<ssize_t>(sizeof i)) {
          break;
        }
      }
      ::_exit(1);
    }
    ::close(pipe_ends[1]);
    // Random in the number of rows and in the moment within one.
    const std::uint64_t rows = random.below(12);
    int acknowledged = next - 1;
    for (std::uint64_t i = 0; i < rows; ++i) {
      ASSERT_EQ(::read(pipe_ends[0], &acknowledged, sizeof acknowledged),
                static_cast<ssize_t>(sizeof acknowledged));
    }
    ::usleep(static_cast<useconds_t>(random.below(4000)));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    while (::read(pipe_ends[0], &acknowledged, sizeof acknowledged) > 0) {
    }
    ::close(pipe_ends[0]);
    auto store = open();
    ASSERT_OK(store);
    const auto audit = store->audit();
    ASSERT_OK(audit);
    ASSERT_TRUE(audit->ok) << "after kill " << kill << ": " << audit->brief();
    const auto history = store->history("MOS2A1");
    ASSERT_OK(history);
    const auto stored = static_cast<int>(history->size());
    ASSERT_GE(stored, acknowledged + 1);
    ASSERT_LE(stored, acknowledged + 2) << "at most the one that was being written";
    for (int i = 0; i < stored; ++i) {
      ASSERT_EQ((*history)[static_cast<std::size_t>(i)].made_at, from_unix_seconds(i));
    }
    next = stored;
  }
  EXPECT_GT(next, kills);
}

}  // namespace
}  // namespace sixpoint::db
