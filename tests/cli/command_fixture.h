// Tests of commands on the real disk: a folder per test, the program inside the test's process.
//
//   TEST_F(CommandTest, UnitsListsTheUnits) {
//     EXPECT_EQ(run({"units", "--store", path("none.db")}).exit_code, 66);
//   }
#pragma once

#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <sqlite3.h>

#include "base/env.h"
#include "db/store.h"
#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint::tests {

class CommandTest : public testing::Test {
 protected:
  static Answer run(const std::vector<std::string>& arguments) {
    return run_command(posix_env(), arguments);
  }
  std::string path(const std::string& name) const { return folder_ / name; }
  // The words of the command that an answer names as the next one, without "sixpoint".
  static std::vector<std::string> next_of(const Answer& answer) {
    std::vector<std::string> words;
    const std::string before = "next: sixpoint ";
    const std::size_t at = answer.people.rfind(before);
    if (at != std::string::npos) {
      std::istringstream line(answer.people.substr(at + before.size()));
      for (std::string word; line >> word;) {
        words.push_back(word);
      }
    }
    return words;
  }
  TemporaryFolder folder_;
};

class StoreTest : public CommandTest {
 protected:
  // A store with one unit MOS2A1, one set of constants (its id is returned) and one repair.
  std::string fill(const std::string& name) {
    auto store = db::Store::open(posix_env(), path(name)).value();
    db::ConstantsRecord record;
    record.serial = "MOS2A1";
    record.filter = "current";
    record.made_at = from_unix_seconds(1000);
    record.document = R"({"constants":{"zero_lsb":[1,2,3]}})";
    const std::string id = store.add_constants(record, "w").value();
    db::RepairRecord repair;
    repair.serial = "MOS2A1";
    repair.input = "a.gt3x";
    repair.constants_id = id;
    repair.document = "{}";
    store.add_repair(repair).value();
    return id;
  }
  // Runs SQL in the file of a store, without the program.
  void statements(const std::string& name, const std::string& sql) {
    sqlite3* handle = nullptr;
    EXPECT_EQ(sqlite3_open(path(name).c_str(), &handle), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sql;
    sqlite3_close(handle);
  }
};

// A virtual unit of 2013 whose stored constants are wrong, and the truth about its sensor.
inline constexpr const char* kDevice =
    "virtual:seed=7,serial=MOS2A45130007,firmware=1.5.0,calibrated=2013-11-12,"
    "positive_lsb=311/310/287,negative_lsb=-204/-216/-234,zero_lsb=54/47/26,"
    "true_sensitivity_lsb_per_g=237.7/251.8/242.3,true_zero_lsb=49.9/95.8/60.8";
// A virtual unit that stands in a virtual jig.
inline constexpr const char* kUnitInJig =
    "virtual:seed=7,serial=MOS2A45130007,firmware=1.5.0,calibrated=2013-11-12,jig=auto";

}  // namespace sixpoint::tests
