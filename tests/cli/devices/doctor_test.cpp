// sixpoint doctor by its contract; store_option_test.cpp has a journal with a damaged entry.
#include <filesystem>
#include <map>

#include "cli/command_fixture.h"
#include "skip_unless.h"

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
  EXPECT_THAT(run({"doctor", "--store", path("none.db")}).out,
              testing::Not(testing::ContainsRegex("ok +udev +[^\n]*not installed")))
      << "others than root could not use units";
  EXPECT_TRUE(fresh.contains("disk") && fresh.contains("usb") && fresh.contains("udev"));
  // What could not be made, and nothing of it is made by asking.
  std::filesystem::create_symlink(path("nowhere/a.db"), path("link.db"));
  for (const std::string& place :
       {path("nodir/x.db"), std::string("/proc/x.db"), path("link.db"), path(".")}) {
    EXPECT_FALSE(checks_of(place).at("store")) << place;
  }
  EXPECT_FALSE(std::filesystem::exists(path("nodir")));
  EXPECT_FALSE(std::filesystem::exists(path("none.db")));
  fill("a.db");
  EXPECT_TRUE(checks_of(path("a.db")).at("store"));
  statements("a.db", "DROP TRIGGER constants_no_update; UPDATE constants SET method = 'other'");
  EXPECT_FALSE(checks_of(path("a.db")).at("store"));
  EXPECT_EQ(run({"doctor", "--store", path("a.db")}).exit_code, 1);
  ::unsetenv("XDG_DATA_HOME");
}

TEST_F(StoreTest, DoctorNamesConstantsOfTheFuture) {
  ::setenv("XDG_DATA_HOME", path("data").c_str(), 1);
  fill("a.db");
  ManualClock clock(from_unix_seconds(1001));
  const auto doctor = [&] {
    Env env{clock, posix_env().files};
    return tests::run_command(env, {"doctor", "--store", path("a.db")});
  };
  EXPECT_THAT(doctor().out, testing::ContainsRegex("ok +store "));
  clock.set(from_unix_seconds(1000 - 3599));
  EXPECT_THAT(doctor().out, testing::ContainsRegex("ok +store ")) << "the clocks of two stations";
  clock.set(from_unix_seconds(1000 - 3601));
  const auto answer = doctor();
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.out, testing::ContainsRegex("NO +store +constants of 1 unit are of a date in "
                                                 "the future, those of MOS2A1 of 1970-01-01"));
  ::unsetenv("XDG_DATA_HOME");
}

// As a user who has no rights there: root has all.
TEST_F(StoreTest, DoctorFailsForAStoreThatTakesNothing) {
  namespace fs = std::filesystem;
  fill("a.db");
  fs::create_directory(path("locked"));
  fs::create_directory(path("free"));
  fs::permissions(folder_.path(), fs::perms(0755));
  fs::permissions(path("free"), fs::perms::all);
  fs::permissions(path("a.db"), fs::perms(0444));
  const auto doctor = [&](const std::string& store) {
    return tests::exit_code_as_other_user({"doctor", "--store", path(store)}, path("free"));
  };
  SIXPOINT_SKIP_UNLESS(::geteuid() == 0, "root, to become another user");
  EXPECT_EQ(doctor("free/x.db"), 0) << "there it can be made";
  EXPECT_EQ(doctor("a.db"), 1) << "it can only be read";
  EXPECT_EQ(doctor("locked/x.db"), 1);
}

}  // namespace
}  // namespace sixpoint
