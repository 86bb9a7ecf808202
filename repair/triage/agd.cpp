#include "repair/triage/agd.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <fmt/format.h>
#include <sqlite3.h>

namespace sixpoint::repair {
namespace {

// A path as part of an SQLite URI: '?', '#' and '%' would end or change it.
std::string uri_of(const std::string& path) {
  std::string uri = "file:";
  for (const char c : path) {
    if (c == '?' || c == '#' || c == '%') {
      uri += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    } else {
      uri += c;
    }
  }
  // immutable: SQLite takes no lock, replays no journal and writes nothing.
  return uri + "?mode=ro&immutable=1";
}

}  // namespace

Result<FileFacts> read_agd_facts(const std::string& path) {
  try {
    const SQLite::Database database(uri_of(path), SQLite::OPEN_READONLY | SQLite::OPEN_URI);
    SQLite::Statement query(database,
                            "SELECT settingName, settingValue FROM settings WHERE settingName IN "
                            "('deviceserial', 'deviceversion')");
    FileFacts facts;
    while (query.executeStep()) {
      (query.getColumn(0).getString() == "deviceserial" ? facts.serial : facts.firmware) =
          query.getColumn(1).getString();
    }
    if (facts.serial.empty()) {
      return fail(ErrorCode::bad_data, "the settings name no unit", path,
                  "export the .agd again from its recording");
    }
    return facts;
  } catch (const SQLite::Exception& exception) {
    const bool missing = exception.getErrorCode() == SQLITE_CANTOPEN;
    return fail(missing ? ErrorCode::no_input : ErrorCode::bad_data,
                fmt::format("cannot be read as an .agd: {}", exception.what()), path,
                "check the path, or export the .agd again from its recording");
  }
}

}  // namespace sixpoint::repair
