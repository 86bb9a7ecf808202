// SQLite files made for tests: an .agd, or what claims to be one.
#pragma once

#include <string>

#include <gtest/gtest.h>
#include <sqlite3.h>

namespace sixpoint::tests {

inline void make_database(const std::string& path, const std::string& sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(database);
}

inline constexpr const char* kSettingsTable =
    "CREATE TABLE settings (settingName TEXT, settingValue TEXT);";

inline void make_agd(const std::string& path, const std::string& serial,
                     const std::string& firmware) {
  make_database(path, std::string(kSettingsTable) +
                          "INSERT INTO settings VALUES ('deviceserial', '" + serial +
                          "'), ('deviceversion', '" + firmware + "'), ('other', 'x');");
}

}  // namespace sixpoint::tests
