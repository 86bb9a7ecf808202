#include "repair/triage/agd.h"

#include <fstream>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "expect_result.h"
#include "repair/made_agd.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

using tests::kSettingsTable;
using tests::make_database;

TEST(Agd, ReadsSerialAndFirmware) {
  const tests::TemporaryFolder folder;
  // Characters that would end an SQLite URI.
  const std::string path = folder / "a?b#c%41 &=\xe9.agd";
  tests::make_agd(path, "MOS2A1", "1.5.0");
  const auto facts = read_agd_facts(path);
  ASSERT_OK(facts);
  EXPECT_EQ(facts->serial, "MOS2A1");
  EXPECT_EQ(facts->firmware, "1.5.0");
  EXPECT_FALSE(facts->calibration_time) << "an .agd does not say it";
}

// In an address the word behind two slashes would be a host.
TEST(Agd, APathMayBeginWithTwoSlashes) {
  const tests::TemporaryFolder folder;
  tests::make_agd(folder / "a.agd", "MOS2A1", "1.5.0");
  ASSERT_OK(read_agd_facts("/" + (folder / "a.agd")));
}

TEST(Agd, RefusesOtherFiles) {
  const tests::TemporaryFolder folder;
  EXPECT_FAILS(read_agd_facts(folder / "none.agd"), ErrorCode::no_input);
  ASSERT_EQ(::mkfifo((folder / "fifo.agd").c_str(), 0600), 0);
  EXPECT_FAILS(read_agd_facts(folder / "fifo.agd"), ErrorCode::no_input);  // and does not wait
  std::ofstream(folder / "text.agd") << "this is no database, and it is long enough to say so";
  EXPECT_FAILS(read_agd_facts(folder / "text.agd"), ErrorCode::bad_data);
  make_database(folder / "empty.agd", kSettingsTable);
  EXPECT_FAILS(read_agd_facts(folder / "empty.agd"), ErrorCode::bad_data);
  make_database(folder / "other.agd", "CREATE TABLE mine (a);");
  EXPECT_FAILS(read_agd_facts(folder / "other.agd"), ErrorCode::bad_data);
}

// Neither may take longer or more memory than a table of settings.
TEST(Agd, RefusesAHostileDatabaseAtOnce) {
  const tests::TemporaryFolder folder;
  make_database(
      folder / "view.agd",
      "CREATE VIEW settings AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
      "SELECT 'deviceserial' AS settingName, i AS settingValue FROM n WHERE i < 0;");
  EXPECT_FAILS(read_agd_facts(folder / "view.agd"), ErrorCode::bad_data);
  make_database(folder / "long.agd",
                std::string(kSettingsTable) +
                    "INSERT INTO settings VALUES ('deviceserial', zeroblob(10000000));");
  EXPECT_FAILS(read_agd_facts(folder / "long.agd"), ErrorCode::bad_data);
  make_database(folder / "rows.agd",
                std::string(kSettingsTable) +
                    "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 300000) "
                    "INSERT INTO settings SELECT 'other', i FROM n;");
  EXPECT_FAILS(read_agd_facts(folder / "rows.agd"), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::repair
