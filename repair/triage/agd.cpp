#include "repair/triage/agd.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>
#include <sqlite3.h>

#include "base/env.h"
#include "gt3x/forms/model.h"

namespace sixpoint::repair {
namespace {

// A path as part of an SQLite URI, whatever bytes it has; a file also where it is ":memory:". Two
// slashes say that no host follows, for a path may begin with two itself. As of the store's
// (db/servers/sqlite_database.cpp), which this room does not see.
std::string uri_of(const std::string& path) {
  std::string uri = path.starts_with('/') ? "file://" : "file:./";
  for (const char c : path) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '/' || c == '.' || c == '-' || c == '_';
    uri += plain ? std::string(1, c) : fmt::format("%{:02x}", static_cast<unsigned char>(c));
  }
  // immutable: SQLite takes no lock, replays no journal and writes nothing.
  return uri + "?mode=ro&immutable=1";
}

// A settings table has some thirty short rows. What needs more than this is no .agd.
constexpr int kLongestValue = 1 << 16;  // bytes
constexpr int kStepsBetweenLooks = 10'000;
constexpr int kMostLooks = 100;  // a million steps of SQLite's machine: some ten milliseconds

// Called by SQLite now and then; another answer than 0 ends the query.
int give_up_after(void* looks) { return ++*static_cast<int*>(looks) > kMostLooks ? 1 : 0; }

}  // namespace

Result<FileFacts> read_agd_facts(const std::string& path) {
  // SQLite would wait for who writes into a FIFO. It reads the real disk, and so does this.
  SIXPOINT_CHECK(posix_env().files.open(path));
  try {
    const SQLite::Database database(uri_of(path), SQLite::OPEN_READONLY | SQLite::OPEN_URI);
    sqlite3_limit(database.getHandle(), SQLITE_LIMIT_LENGTH, kLongestValue);
    int looks = 0;
    sqlite3_progress_handler(database.getHandle(), kStepsBetweenLooks, &give_up_after, &looks);
    // Only a table: a view of that name may run on without an end.
    SQLite::Statement table(
        database, "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'settings'");
    if (!table.executeStep()) {
      return fail(ErrorCode::bad_data, "the file holds no table of settings, so it is no .agd",
                  path, "check that this is the file that ActiLife wrote");
    }
    SQLite::Statement query(database,
                            "SELECT settingName, settingValue FROM settings WHERE settingName IN "
                            "('deviceserial', 'deviceversion')");
    FileFacts facts;
    while (query.executeStep()) {
      (query.getColumn(0).getString() == "deviceserial" ? facts.serial : facts.firmware) =
          query.getColumn(1).getString();
    }
    facts.serial = gt3x::unit_serial(facts.serial);
    if (facts.serial.empty()) {
      return fail(ErrorCode::bad_data, "the settings name no unit", path,
                  "export the .agd again from its recording");
    }
    return facts;
  } catch (const SQLite::Exception& exception) {
    return fail(ErrorCode::bad_data, fmt::format("cannot be read as an .agd: {}", exception.what()),
                path, "export the .agd again from its recording");
  }
}

}  // namespace sixpoint::repair
