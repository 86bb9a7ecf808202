// sixpoint doctor by its contract; store_option_test.cpp has a journal with a damaged entry.
#include <map>

#include "cli/command_fixture.h"

namespace sixpoint {
namespace {

using tests::StoreTest;

TEST_F(StoreTest, DoctorAnswersEveryCheckAndFailsForAStoreThatWasChanged) {
  ::setenv("XDG_DATA_HOME", path("data").c_str(), 1);
  const auto checks_of = [&](const std::string& store) {
    const auto json = run({"doctor", "--store", store, "--json"}).json();
    EXPECT_EQ(json["schema"], "sixpoint/doctor/1");
    std::map<std::string, bool> checks;
    for (const auto& check : json["checks"]) {
      EXPECT_FALSE(check["hint"].get<std::string>().empty()) << check;
      checks[check["name"]] = check["ok"];
    }
    return checks;
  };
  const auto fresh = checks_of(path("none.db"));
  EXPECT_EQ(fresh.size(), 6U);
  for (const char* name : {"version", "store", "journal"}) {
    EXPECT_TRUE(fresh.at(name)) << name;
  }
  EXPECT_TRUE(fresh.contains("disk") && fresh.contains("usb") && fresh.contains("udev"));
  fill("a.db");
  statements("a.db", "DROP TRIGGER constants_no_update; UPDATE constants SET method = 'other'");
  EXPECT_FALSE(checks_of(path("a.db")).at("store"));
  EXPECT_EQ(run({"doctor", "--store", path("a.db")}).exit_code, 1);
  ::unsetenv("XDG_DATA_HOME");
}

}  // namespace
}  // namespace sixpoint
