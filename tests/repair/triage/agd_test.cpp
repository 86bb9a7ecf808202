#include "repair/triage/agd.h"

#include <fstream>

#include <gtest/gtest.h>
#include <sqlite3.h>

#include "expect_result.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

void make(const std::string& path, const std::string& sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(database);
}

constexpr const char* kTable = "CREATE TABLE settings (settingName TEXT, settingValue TEXT);";

TEST(Agd, ReadsSerialAndFirmware) {
  const tests::TemporaryFolder folder;
  // Characters that would end an SQLite URI.
  const std::string path = folder / "a?b#c%41.agd";
  make(path, std::string(kTable) +
                 "INSERT INTO settings VALUES ('deviceserial', 'MOS2A1'), ('deviceversion', "
                 "'1.5.0'), ('other', 'x');");
  const auto facts = read_agd_facts(path);
  ASSERT_OK(facts);
  EXPECT_EQ(facts->serial, "MOS2A1");
  EXPECT_EQ(facts->firmware, "1.5.0");
  EXPECT_FALSE(facts->calibration_time) << "an .agd does not say it";
}

TEST(Agd, RefusesOtherFiles) {
  const tests::TemporaryFolder folder;
  EXPECT_FAILS(read_agd_facts(folder / "none.agd"), ErrorCode::no_input);
  std::ofstream(folder / "text.agd") << "this is no database, and it is long enough to say so";
  EXPECT_FAILS(read_agd_facts(folder / "text.agd"), ErrorCode::bad_data);
  make(folder / "empty.agd", kTable);
  EXPECT_FAILS(read_agd_facts(folder / "empty.agd"), ErrorCode::bad_data);
  make(folder / "other.agd", "CREATE TABLE mine (a);");
  EXPECT_FAILS(read_agd_facts(folder / "other.agd"), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::repair
