#include <array>
#include <functional>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/temporaries.h"
#include "db/exchange.h"
#include "db/history.h"

namespace sixpoint::db {
namespace {

// Makes `path` a store that `fill` filled, whole or not at all: under another name first, which no
// other process has, since it has the name and the lock of an AtomicFile before it. That lock is no
// lock of the store itself: over NFS, SQLite could not take its own then.
Result<ExchangeReport> make_store_file(
    Env& env, const std::string& path,
    const std::function<Result<ExchangeReport>(const std::string& temporary)>& fill) {
  SIXPOINT_ASSIGN(const AtomicFile locked, AtomicFile::create(env.files, path));
  const std::string temporary = locked.temporary() + ".db";
  constexpr std::array kSuffixes = {"", "-journal", "-wal", "-shm"};
  const auto remove = [&] {
    for (const char* suffix : kSuffixes) {
      if (env.files.info(temporary + suffix)) {
        static_cast<void>(env.files.remove(temporary + suffix));
      }
    }
  };
  remove();  // what a process that is gone left
  for (const char* suffix : kSuffixes) {
    note_temporary(temporary + suffix);
  }
  // Afterwards the store is closed: SQLite has synced it and removed its own files beside it.
  auto report = fill(temporary);
  if (report) {
    if (Status placed = put_in_place(env.files, temporary, path); !placed) {
      report = fail(std::move(placed).error());
    }
  }
  if (!report) {
    remove();
  }
  for (const char* suffix : kSuffixes) {
    forget_temporary(temporary + suffix);
  }
  return report;
}

Status copy_rows(Database& from, Database& to) {
  SIXPOINT_ASSIGN(const auto reading, Transaction::reading(from));
  SIXPOINT_ASSIGN(auto writing, Transaction::writing(to));
  SIXPOINT_ASSIGN(auto writer, HistoryWriter::open(to));
  SIXPOINT_CHECK(for_each_attachment(from, [&](const std::string& name, const Bytes& bytes) {
    return writer.add_attachment(name, bytes);
  }));
  SIXPOINT_CHECK(
      for_each_history_row(from, [&](const HistoryRow& row) { return writer.append_copy(row); }));
  SIXPOINT_CHECK(writer.finish());
  return writing.commit();
}

}  // namespace

Result<ExchangeReport> backup(Store& store, Env& env, const std::string& path) {
  if (path == store.database().location() || env.files.info(path + "-wal")) {
    return fail(ErrorCode::cannot_create, "a store is at work there", path,
                "choose another name for the backup");
  }
  return make_store_file(env, path, [&](const std::string& temporary) -> Result<ExchangeReport> {
    SIXPOINT_ASSIGN(const Head before, read_head(store.database()));
    SIXPOINT_ASSIGN(const bool copied, store.database().copy_to_file(temporary));
    // Opening makes a new store where PostgreSQL had no means of its own; both are then checked.
    SIXPOINT_ASSIGN(auto copy, Store::open(env, temporary));
    if (!copied) {
      SIXPOINT_CHECK(copy_rows(store.database(), copy.database()));
    }
    SIXPOINT_ASSIGN(const AuditReport audit, copy.audit());
    if (!audit.ok) {
      return fail(ErrorCode::bad_data, fmt::format("the store is damaged: {}", audit.brief()),
                  store.database().location(),
                  "no backup was made; 'sixpoint audit verify' lists what was changed");
    }
    if (audit.rows < before.rows) {  // opening makes an empty store where the copy was removed
      return fail(ErrorCode::io,
                  fmt::format("the store has {} rows, its copy {}", before.rows, audit.rows), path,
                  "see what removes or replaces files in this folder, and make the backup again");
    }
    SIXPOINT_ASSIGN(const auto count, copy.database().query("SELECT count(*) FROM attachments"));
    return ExchangeReport{audit.rows, 0, integer_of(count[0][0]), audit.head};
  });
}

Result<ExchangeReport> import_into_new_file(Env& env, const std::string& input,
                                            const std::string& path) {
  SIXPOINT_CHECK(env.files.info(input));
  return make_store_file(env, path, [&](const std::string& temporary) -> Result<ExchangeReport> {
    SIXPOINT_ASSIGN(auto store, Store::open(env, temporary));
    SIXPOINT_ASSIGN(const auto report, import_json_lines(store, env.files, input));
    if (env.files.info(path)) {
      return fail(ErrorCode::cannot_create, "another program made a store there meanwhile", path,
                  "import again: it continues a store that has the beginning of the same chain");
    }
    return report;
  });
}

}  // namespace sixpoint::db
