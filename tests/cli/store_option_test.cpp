// --store: the places of a store and of its journal, and where records go when the store fails.
#include "cli/store_option.h"

#include <csignal>
#include <filesystem>
#include <fstream>

#include <pwd.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "command_fixture.h"
#include "db/journal.h"
#include "station/records/software.h"

namespace sixpoint {
namespace {

using testing::HasSubstr;
using tests::StoreTest;

TEST_F(StoreTest, OneStoreHasOneJournalHoweverItIsNamed) {
  EXPECT_EQ(cli::journal_folder(path("a.db")), cli::journal_folder(path("./sub/../a.db")));
  EXPECT_NE(cli::journal_folder(path("a.db")), cli::journal_folder(path("b.db")));
  const std::string server = "postgresql://ada:secret@plant.example/units";
  EXPECT_EQ(cli::journal_folder(server),
            cli::journal_folder("postgresql://ada:changed@plant.example/units"));
  EXPECT_NE(cli::journal_folder(server), cli::journal_folder("postgresql://plant.example/other"));
  EXPECT_EQ(cli::journal_folder(server).find("secret"), std::string::npos);
}

TEST_F(StoreTest, AStoreOnAServerIsItsPlaceAndNotWhoAsks) {
  const std::string place = "postgresql://127.0.0.1:5433/units";
  for (const char* same : {"?user=ada&password=a", "?password=a@b&user=bo", "?sslmode=require"}) {
    EXPECT_EQ(cli::journal_folder(place + same), cli::journal_folder(place)) << same;
  }
  for (const char* other : {"?dbname=lab", "?password=a&host=plant.example", "?port=5434"}) {
    EXPECT_NE(cli::journal_folder(place + other), cli::journal_folder(place)) << other;
  }
}

// A run under way must not go on into another store of the same name in another folder.
TEST_F(StoreTest, ARunUnderWayBelongsToOneStoreHoweverItIsNamed) {
  const std::string here = cli::run_folder_name(path("bench.db"), "MOS2A1");
  EXPECT_EQ(here, cli::run_folder_name(path("./sub/../bench.db"), "MOS2A1"));
  EXPECT_NE(here, cli::run_folder_name(path("bench.db"), "MOS2A2"));
  const auto before = std::filesystem::current_path();
  std::filesystem::create_directory(path("other"));
  std::filesystem::current_path(path("."));
  const std::string from_here = cli::run_folder_name("bench.db", "MOS2A1");
  std::filesystem::current_path(path("other"));
  const std::string from_there = cli::run_folder_name("bench.db", "MOS2A1");
  std::filesystem::current_path(before);
  EXPECT_EQ(from_here, here);
  EXPECT_NE(from_there, here);
}

TEST_F(StoreTest, TheDefaultStoreIsThatOfTheEnvironment) {
  ::setenv("XDG_DATA_HOME", path("data").c_str(), 1);
  ::setenv("SIXPOINT_STORE", path("chosen.db").c_str(), 1);
  EXPECT_EQ(cli::default_store(), path("chosen.db"));
  ::unsetenv("SIXPOINT_STORE");
  EXPECT_EQ(cli::default_store(), path("data/sixpoint/store.db"));
  EXPECT_EQ(run({"units"}).exit_code, 66) << "reading makes no store";
  EXPECT_FALSE(std::filesystem::exists(path("data")));
  ::unsetenv("XDG_DATA_HOME");
}

// Oracle: the user's entry in passwd. The folder in which the program runs would be another store
// each time.
TEST_F(StoreTest, WithoutHomeTheDefaultStoreIsInTheUsersOwnFolder) {
  ::unsetenv("XDG_DATA_HOME");
  ::unsetenv("SIXPOINT_STORE");
  const char* home = std::getenv("HOME");
  const std::string kept = home == nullptr ? "" : home;
  for (const bool empty : {false, true}) {
    empty ? ::setenv("HOME", "", 1) : ::unsetenv("HOME");
    EXPECT_EQ(cli::default_store(),
              std::string(::getpwuid(::getuid())->pw_dir) + "/.local/share/sixpoint/store.db");
  }
  ::setenv("HOME", kept.c_str(), 1);
}

// Runs the jig on a store that refuses; what was measured must be in the journal, and in the store
// once that is as it should be.
class RefusingStore : public StoreTest {
 protected:
  RefusingStore() { ::setenv("XDG_DATA_HOME", (folder_ / "data").c_str(), 1); }
  ~RefusingStore() override { ::unsetenv("XDG_DATA_HOME"); }
  tests::Answer jig(const std::string& store) {
    return run({"jig", "--device", tests::kDevice, "--jig", "virtual", "--store", store, "--json"});
  }
  // Whether the record is in the store's journal, so that no store has it yet.
  static bool waits(const std::string& store, const std::string& id) {
    return db::Journal::holds(posix_env().files, cli::journal_folder(store), id).value();
  }
  void expect_in_journal(const std::string& store, const tests::Answer& answer) {
    const auto json = answer.json();
    EXPECT_EQ(json["verdict"], "pass");
    EXPECT_EQ(json["kept"]["in"], "journal") << answer.people;
    EXPECT_EQ(json["kept"]["folder"], cli::journal_folder(store));
    auto journal = db::Journal::open(posix_env().files, cli::journal_folder(store)).value();
    EXPECT_GE(journal.pending().value(), 2U) << "the run and its constants";
    EXPECT_TRUE(waits(store, json["stored_id"]));
  }
};

TEST_F(RefusingStore, ANewerADamagedAndAMissingPlaceLoseNoRun) {
  fill("newer.db");
  statements("newer.db", "PRAGMA user_version=99");
  const auto newer = jig(path("newer.db"));
  EXPECT_EQ(newer.exit_code, 78);
  expect_in_journal(path("newer.db"), newer);
  std::ofstream(path("text.db")) << std::string(2000, 'x');
  const auto damaged = jig(path("text.db"));
  EXPECT_EQ(damaged.exit_code, 65);
  expect_in_journal(path("text.db"), damaged);
  const auto missing = jig(path("none/store.db"));
  EXPECT_EQ(missing.exit_code, 73);
  expect_in_journal(path("none/store.db"), missing);
  // Once the folder is there, the next run catches up first.
  std::filesystem::create_directory(path("none"));
  const auto next = jig(path("none/store.db"));
  EXPECT_EQ(next.exit_code, 0) << next.people;
  const auto history =
      run({"history", "MOS2A45130007", "--store", path("none/store.db"), "--json"}).json();
  ASSERT_EQ(history["runs"].size(), 2U);
  EXPECT_EQ(history["runs"][0]["id"], missing.json()["run"]);
  const std::string constants_id = missing.json()["stored_id"];
  EXPECT_EQ(history["constants"][0]["id"], constants_id);
  EXPECT_FALSE(waits(path("none/store.db"), constants_id));
  EXPECT_EQ(run({"audit", "verify", "--store", path("none/store.db")}).exit_code, 0);
}

TEST_F(RefusingStore, ADamagedEntryOfTheJournalLosesNoLaterRun) {
  const std::string away = "postgresql://station@127.0.0.1:1/plant";
  EXPECT_EQ(jig(away).exit_code, 0);
  const std::string folder = cli::journal_folder(away);
  const auto first = posix_env().files.list(folder)->front();
  std::filesystem::resize_file(folder + "/" + first, 100);
  // The same journal in front of a store that is there.
  std::filesystem::create_directories(
      std::filesystem::path(cli::journal_folder(path("a.db"))).parent_path());
  std::filesystem::rename(folder, cli::journal_folder(path("a.db")));
  const auto answer = jig(path("a.db"));
  EXPECT_EQ(answer.exit_code, 65);
  EXPECT_THAT(answer.people, HasSubstr(first));
  expect_in_journal(path("a.db"), answer);
  EXPECT_EQ(run({"store", "catch-up", "--store", path("a.db")}).exit_code, 65);
  const auto doctor = run({"doctor", "--store", path("a.db"), "--json"});
  EXPECT_EQ(doctor.exit_code, 1);
  EXPECT_THAT(doctor.out, HasSubstr("entries wait in"));
}

// The store can be read when the files are repaired, and refuses the records afterwards.
TEST_F(RefusingStore, ARepairThatTheStoreDoesNotTakeIsJournalledAndResumedOnce) {
  const std::string store = path("a.db");
  EXPECT_EQ(jig(store).exit_code, 0);
  std::filesystem::create_directory(path("archive"));
  for (const char* name : {"a", "b"}) {
    std::ofstream(path("s.json")) << R"({"schema": "sixpoint/scenario/1", "seed": )"
                                  << (name[0] - 'a') << R"(, "unit": {
        "serial": "MOS2A45130007", "firmware": "1.5.0", "calibrated": "2013-11-12T14:32:13Z",
        "constants": {"positive_lsb": [311, 310, 287], "negative_lsb": [-204, -216, -234],
                      "zero_lsb": [54, 47, 26]},
        "sensor": {"current": {"sensitivity_lsb_per_g": [237.7, 251.8, 242.3],
                               "zero_lsb": [49.9, 95.8, 60.8]}}},
        "motions": [{"kind": "free_living", "duration_s": 900}]})";
    ASSERT_EQ(run({"simulate", "--scenario", path("s.json"), "-o",
                   path(std::string("archive/") + name + ".gt3x")})
                  .exit_code,
              0);
  }
  const auto repair = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"repair",  path("archive"), "-o",    path("repaired"),
                                      "--store", store,           "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  };
  // A trigger of another program: the store refuses every repair.
  statements("a.db",
             "CREATE TRIGGER full BEFORE INSERT ON repairs BEGIN SELECT RAISE(ABORT, 'no'); END");
  const auto refused = repair({});
  EXPECT_EQ(refused.exit_code, 65) << refused.people;
  EXPECT_EQ(refused.json()["summary"]["repaired"], 2);
  EXPECT_EQ(refused.json()["kept"]["in"], "journal");
  auto journal = db::Journal::open(posix_env().files, cli::journal_folder(store)).value();
  EXPECT_EQ(journal.pending().value(), 2U);
  statements("a.db", "DROP TRIGGER full");
  EXPECT_EQ(run({"store", "catch-up", "--store", store}).exit_code, 0);
  EXPECT_EQ(journal.pending().value(), 0U);
  // Again: a repair is stored once.
  const auto again = repair({"--resume"});
  EXPECT_EQ(again.exit_code, 0) << again.people;
  EXPECT_EQ(again.json()["summary"]["repaired"], 2);
  const auto history = run({"history", "MOS2A45130007", "--store", store, "--json"}).json();
  ASSERT_EQ(history["repairs"].size(), 2U);
  EXPECT_EQ(history["repairs"][0]["constants"], history["constants"][0]["id"]);
  EXPECT_THAT(history["repairs"][0]["software"].get<std::string>(),
              testing::StartsWith(station::software_name()));
}

TEST_F(RefusingStore, CaptureAndSolveKeepTheirConstantsInTheJournal) {
  const std::string away = "postgresql://station@127.0.0.1:1/plant";
  auto journal = db::Journal::open(posix_env().files, cli::journal_folder(away)).value();
  const auto capture = run({"capture", "--device", tests::kUnitInJig, "--jig", "virtual", "-o",
                            path("c.gt3x"), "--store", away, "--json"});
  EXPECT_EQ(capture.exit_code, 0) << capture.people;
  EXPECT_EQ(capture.json()["kept"]["in"], "journal");
  EXPECT_EQ(journal.pending().value(), 1U);
  const auto solve = run({"solve", path("c.gt3x"), "--save", "--store", path("c.gt3x"), "--json"});
  EXPECT_EQ(solve.exit_code, 65) << "a recording is no store";
  EXPECT_EQ(solve.json()["kept"]["in"], "journal");
  EXPECT_FALSE(solve.json()["stored_id"].is_null());
  EXPECT_THAT(solve.people, HasSubstr("nothing is lost"));
}

TEST_F(RefusingStore, WithoutAnyFolderTheReportIsStillPrinted) {
  const std::string last_resort =
      "/" + ("sixpoint-journal-" + file_name_of(cli::journal_folder(path("a.db"))));
  const pid_t child = ::fork();
  if (child == 0) {
    // No file of this process may have a byte: neither store nor journal nor last resort.
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{0, 0};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const auto answer = jig(path("a.db"));
    const bool good = answer.exit_code == 74 && answer.json()["verdict"] == "pass" &&
                      answer.json()["poses"].size() == 6 &&
                      answer.json()["error"]["code"] == "io" &&
                      answer.people.find("could not be kept anywhere") != std::string::npos;
    ::_exit(good ? 0 : 1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_FALSE(std::filesystem::exists("." + last_resort)) << "an empty folder stays";
  EXPECT_FALSE(
      std::filesystem::exists(std::filesystem::temp_directory_path().string() + last_resort));
}

TEST_F(RefusingStore, WithoutAJournalsFolderTheWorkingFolderTakesIt) {
  std::ofstream(path("data")) << "in the way of the folder data/";
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder_.path());
  const auto answer = jig("none/store.db");
  EXPECT_EQ(answer.exit_code, 74) << answer.people;
  const std::string folder = answer.json()["kept"]["folder"];
  EXPECT_THAT(folder, testing::StartsWith("./sixpoint-journal-"));
  EXPECT_THAT(answer.people, HasSubstr("--journal " + folder));
  const auto doctor = run({"doctor", "--store", "none/store.db"});
  EXPECT_THAT(doctor.out, HasSubstr("wait in " + folder)) << doctor.people;
  EXPECT_THAT(doctor.out, HasSubstr("--journal " + folder));
  std::filesystem::create_directory("none");
  const auto catch_up = [&](const std::string& store) {
    return run({"store", "catch-up", "--journal", folder, "--store", store, "--json"});
  };
  EXPECT_EQ(catch_up("none/stoer.db").exit_code, 66) << "another store's folder: none is made";
  EXPECT_EQ(catch_up("none/store.db").json()["taken"], 2) << "it is made";
  EXPECT_EQ(
      run({"store", "catch-up", "--journal", "no-folder", "--store", "none/store.db"}).exit_code,
      66);
  std::filesystem::current_path(before);
}

// The name can be foreseen, and anybody may make it in the temporary folder.
TEST_F(RefusingStore, ALastResortThatIsAnotherUsersOrALinkIsNotTaken) {
  std::ofstream(path("data")) << "in the way of the folder data/";
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder_.path());
  for (const char* folder : {"tmp", "elsewhere"}) {
    std::filesystem::create_directory(folder);
  }
  ::setenv("TMPDIR", path("tmp").c_str(), 1);
  const std::string name = "sixpoint-journal-" + file_name_of(cli::journal_folder("none/store.db"));
  const auto expect_refused = [&] {
    const auto answer = jig("none/store.db");
    EXPECT_EQ(answer.exit_code, 74);
    EXPECT_THAT(answer.people, HasSubstr("could not be kept anywhere"));
  };
  for (const std::string& place : {name, "tmp/" + name}) {
    std::filesystem::create_directory_symlink(path("elsewhere"), place);
  }
  expect_refused();
  EXPECT_TRUE(std::filesystem::is_empty("elsewhere"));
  if (::geteuid() == 0) {
    for (const std::string& place : {name, "tmp/" + name}) {
      std::filesystem::remove(place);
      std::filesystem::create_directory(place);
      ASSERT_EQ(::chown(place.c_str(), 65534, 65534), 0);
    }
    expect_refused();
    EXPECT_TRUE(std::filesystem::is_empty(name));
  }
  ::unsetenv("TMPDIR");
  std::filesystem::current_path(before);
}

// The store's file and folder may be read and not written: it answers, and the run is journalled.
// Root may write everywhere, so a child is an ordinary user.
TEST_F(RefusingStore, AReadOnlyPlaceLosesNoRun) {
  std::filesystem::create_directory(path("disc"));
  std::filesystem::create_directory(path("data"));
  fill("disc/a.db");
  const std::string store = path("disc/a.db");
  for (const auto& [name, mode] : {std::pair{folder_.path(), 0755},
                                   {path("data"), 0777},
                                   {store, 0444},
                                   {path("disc"), 0555}}) {
    ASSERT_EQ(::chmod(name.c_str(), static_cast<mode_t>(mode)), 0);
  }
  const pid_t child = ::fork();
  if (child == 0) {
    if (::geteuid() == 0 && ::setuid(65534) != 0) {
      ::_exit(100);
    }
    int wrong = run({"units", "--store", store}).exit_code == 0 ? 0 : 1;
    wrong += run({"audit", "verify", "--store", store}).exit_code == 0 ? 0 : 2;
    wrong += run({"history", "MOS2A1", "--store", store}).exit_code == 0 ? 0 : 4;
    wrong += run({"statistics", "--store", store}).exit_code == 0 ? 0 : 8;
    const auto answer = jig(store);
    wrong += answer.exit_code == 77 ? 0 : 16;
    expect_in_journal(store, answer);
    ::_exit(wrong + (HasFailure() ? 32 : 0));
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  ASSERT_EQ(::chmod(path("disc").c_str(), 0755), 0);
}

TEST_F(StoreTest, AJigRunIsKeptInTheJournalWhileTheServerIsAway) {
  ::setenv("XDG_DATA_HOME", folder_.path().c_str(), 1);
  const std::string away = "postgresql://station:s3cret@127.0.0.1:1/plant";
  const auto answer =
      run({"jig", "--device",
           "virtual:seed=7,serial=MOS2A45130007,firmware=1.5.0,calibrated=2013-11-12,jig=auto",
           "--jig", "virtual", "--operator", "Ada", "--store", away, "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_THAT(answer.people, HasSubstr("journal"));
  EXPECT_THAT(answer.people, testing::Not(HasSubstr("s3cret")));
  EXPECT_EQ(cli::journal_folder(away),
            cli::journal_folder("postgresql://station:other@127.0.0.1:1/plant"));
  auto journal = db::Journal::open(posix_env().files, cli::journal_folder(away)).value();
  EXPECT_EQ(journal.pending().value(), 2U) << "the run and its constants";
  EXPECT_EQ(run({"store", "catch-up", "--store", away}).exit_code, 69);
  auto store = db::Store::open(posix_env(), path("a.db")).value();
  EXPECT_EQ(journal.catch_up(store).value(), 2U);
  EXPECT_EQ(store.history("MOS2A45130007")->front().id, answer.json()["stored_id"]);
  ::unsetenv("XDG_DATA_HOME");
}

}  // namespace
}  // namespace sixpoint
