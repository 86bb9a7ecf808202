// sixpoint store ... by its contract, on the real disk.
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/env.h"
#include "db/journal.h"
#include "db/store.h"
#include "expect_result.h"
#include "run_command.h"
#include "station/cli/store_option.h"
#include "station/limits.h"
#include "station/software.h"
#include "temporary_folder.h"

namespace sixpoint {
namespace {

using testing::HasSubstr;

class StoreCommandTest : public testing::Test {
 protected:
  tests::Answer run(const std::vector<std::string>& arguments) {
    return tests::run_command(posix_env(), arguments);
  }
  std::string path(const std::string& name) const { return folder_ / name; }
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
  void statements(const std::string& name, const std::string& sql) {
    sqlite3* handle = nullptr;
    EXPECT_EQ(sqlite3_open(path(name).c_str(), &handle), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sql;
    sqlite3_close(handle);
  }
  tests::TemporaryFolder folder_;
};

TEST_F(StoreCommandTest, ExportImportAndBackupKeepTheHead) {
  fill("a.db");
  const auto head = [&](const std::string& name) {
    return run({"audit", "verify", "--store", path(name), "--json"}).json()["head"];
  };
  const auto out =
      run({"store", "export", "--store", path("a.db"), "-o", path("a.jsonl"), "--json"});
  EXPECT_EQ(out.exit_code, 0) << out.people;
  EXPECT_EQ(out.json()["schema"], "sixpoint/store/1");
  EXPECT_EQ(out.json()["head"], head("a.db"));
  EXPECT_EQ(run({"store", "import", path("a.jsonl"), "--store", path("b.db")}).exit_code, 0);
  EXPECT_EQ(head("b.db"), head("a.db"));
  EXPECT_EQ(run({"store", "backup", "--store", path("a.db"), "-o", path("c.db")}).exit_code, 0);
  EXPECT_EQ(head("c.db"), head("a.db"));
  EXPECT_EQ(run({"store", "export", "--csv", "--store", path("a.db"), "-o", path("csv")}).exit_code,
            0);
  EXPECT_TRUE(std::filesystem::exists(path("csv") + "/constants.csv"));
  EXPECT_EQ(run({"store", "backup", "--store", path("a.db"), "-o", path("a.db")}).exit_code, 73);
  EXPECT_EQ(run({"store", "export", "--store", path("none.db"), "-o", path("x")}).exit_code, 66);
  EXPECT_EQ(run({"store", "import", path("none.jsonl"), "--store", path("d.db")}).exit_code, 66);
  EXPECT_FALSE(std::filesystem::exists(path("d.db")));
  std::ofstream(path("bad.jsonl")) << "{}\n";
  EXPECT_EQ(run({"store", "import", path("bad.jsonl"), "--store", path("d.db")}).exit_code, 65);
  EXPECT_FALSE(std::filesystem::exists(path("d.db"))) << "a refused import leaves no empty store";
  EXPECT_EQ(run({"store", "import", path("csv"), "--store", path("e.db")}).exit_code, 0);
  EXPECT_EQ(head("e.db"), head("a.db"));
  EXPECT_EQ(
      run({"store", "import", path("csv"), "--store", path("a.db"), "--json"}).json()["added"], 0);
}

TEST_F(StoreCommandTest, WithdrawnConstantsRecallTheirFiles) {
  const std::string id = fill("a.db");
  EXPECT_EQ(run({"store", "recall", "--store", path("a.db"), "--json"}).json()["files"].size(), 0U);
  EXPECT_EQ(run({"store", "withdraw", id, "--store", path("a.db")}).exit_code, 64) << "no reason";
  const auto withdrawn = run({"store", "withdraw", id, "--reason", "out of level", "--operator",
                              "Ada", "--store", path("a.db"), "--json"});
  EXPECT_EQ(withdrawn.json()["recall"], 1);
  const auto recall = run({"store", "recall", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(recall["files"][0]["input"], "a.gt3x");
  EXPECT_EQ(recall["files"][0]["reason"], "out of level");
  const auto trend = run({"store", "trend", "MOS2A1", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(trend["points"][0]["withdrawn"], true);
  EXPECT_EQ(trend["points"][0]["constants"]["zero_lsb"][2], 3);
  const auto due = run({"store", "due", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(due["units"][0]["serial"], "MOS2A1");
  EXPECT_TRUE(due["units"][0]["last_constants"].is_null()) << "the only set was withdrawn";
  const auto yield = run({"store", "yield", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(yield["units"], 0);
  EXPECT_TRUE(yield["yield"].is_null());
  EXPECT_EQ(run({"store", "trend", "nobody", "--store", path("a.db")}).exit_code, 66);
}

TEST_F(StoreCommandTest, CorrectionsAreSaidWithTheirReason) {
  const std::string id = fill("a.db");
  const auto correct = [&](std::vector<std::string> words) {
    for (const char* more : {"--operator", "Ada", "--store"}) {
      words.emplace_back(more);
    }
    words.push_back(path("a.db"));
    words.insert(words.begin(), "store");
    return run(words).exit_code;
  };
  const auto constants = [&] {
    return run({"history", "MOS2A1", "--store", path("a.db"), "--json"}).json()["constants"][0];
  };
  EXPECT_EQ(correct({"withdraw", id, "--reason", "wrong jig"}), 0);
  EXPECT_EQ(constants()["withdrawn"], true);
  EXPECT_EQ(correct({"reinstate", id, "--reason", "it was right"}), 0);
  EXPECT_EQ(constants()["withdrawn"], false);
  EXPECT_EQ(correct({"note", "units", "MOS2A1", "--reason", "came back twice"}), 0);
  EXPECT_EQ(correct({"note", "units", "MOS2A1"}), 64);
  EXPECT_EQ(correct({"note", "units", "nobody", "--reason", "x"}), 66);
  EXPECT_EQ(correct({"note", "nothing", "MOS2A1", "--reason", "x"}), 64);
  const auto history = run({"history", "MOS2A1", "--store", path("a.db"), "--json"}).json();
  ASSERT_EQ(history["corrections"].size(), 3U);
  EXPECT_EQ(history["corrections"][2]["about"]["table"], "units");
  EXPECT_EQ(history["corrections"][2]["reason"], "came back twice");
  EXPECT_EQ(history["repairs"][0]["input"], "a.gt3x");
}

TEST_F(StoreCommandTest, AHeadThatWasWrittenDownMustBeInTheChain) {
  fill("a.db");
  const auto verify = [&](const std::string& head) {
    return run({"audit", "verify", "--store", path("a.db"), "--head", head, "--json"});
  };
  const std::string head = verify("").json()["head"];
  EXPECT_EQ(verify(head).exit_code, 0);
  EXPECT_EQ(verify(std::string(64, 'a')).exit_code, 1);
  EXPECT_EQ(verify("abc").exit_code, 64);
}

// What goes wrong with a store, by the exit codes of the contract and in words that name the place.
TEST_F(StoreCommandTest, StoresThatCannotBeUsedAreNamedWithTheirReason) {
  const auto expect = [&](const std::vector<std::string>& command, int code,
                          const std::string& words) {
    SCOPED_TRACE(testing::PrintToString(command));
    const auto answer = run(command);
    EXPECT_EQ(answer.exit_code, code) << answer.people;
    EXPECT_THAT(answer.people, HasSubstr(words));
    if (code >= 64) {
      EXPECT_THAT(answer.people, HasSubstr("; ")) << "what to do";
    }
  };
  fill("newer.db");
  statements("newer.db", "PRAGMA user_version=99");
  std::ofstream(path("text.db")) << std::string(2000, 'x');
  fill("damaged.db");
  {
    // Every page but the first: whatever is asked, a damaged one is met.
    std::fstream file(path("damaged.db"), std::ios::in | std::ios::out | std::ios::binary);
    const auto size = std::filesystem::file_size(path("damaged.db"));
    file.seekp(4096);
    file << std::string(size - 4096, '\x5a');
  }
  fill("touched.db");
  statements("touched.db",
             "DROP TRIGGER constants_no_update; UPDATE constants SET method = 'other'");
  for (const auto& command :
       std::vector<std::vector<std::string>>{{"units", "--store"},
                                             {"history", "MOS2A1", "--store"},
                                             {"audit", "verify", "--store"}}) {
    const auto on = [&](const std::string& name) {
      auto words = command;
      words.push_back(path(name));
      return words;
    };
    expect(on("newer.db"), 78, "version 99");
    expect(on("text.db"), 65, "text.db");
    expect(on("damaged.db"), 65, "damaged.db");
    expect(on("none.db"), 66, "none.db");
  }
  expect({"audit", "verify", "--store", path("touched.db")}, 1, "does not fit the chain");
  EXPECT_EQ(run({"store", "backup", "--store", path("touched.db"), "-o", path("b.db")}).exit_code,
            65);
  EXPECT_FALSE(std::filesystem::exists(path("b.db"))) << "no backup of a damaged store";
  expect({"store", "export", "--store", path("touched.db"), "-o", path("t.jsonl")}, 0, "rows");
  expect({"store", "import", path("t.jsonl"), "--store", path("new.db")}, 65, "line ");
  EXPECT_FALSE(std::filesystem::exists(path("new.db")));
  expect({"store", "export", "--store", path("newer.db"), "-o", path("n.jsonl")}, 78, "version 99");
}

TEST_F(StoreCommandTest, AFileOrFolderThatMayNotBeWrittenIsSaidSo) {
  fill("a.db");
  std::filesystem::create_directory(path("locked"));
  std::filesystem::copy_file(path("a.db"), path("locked/a.db"));
  std::filesystem::permissions(path("a.db"), std::filesystem::perms(0444));
  std::filesystem::permissions(path("locked/a.db"), std::filesystem::perms(0444));
  std::filesystem::permissions(path("locked"), std::filesystem::perms(0555));
  std::filesystem::permissions(folder_.path(), std::filesystem::perms(0555));
  const auto as_nobody = [&](const std::vector<std::string>& words) {
    const pid_t child = ::fork();
    if (child == 0) {
      // Root may write everywhere: be nobody.
      if (::geteuid() == 0 && ::setuid(65534) != 0) {
        ::_exit(100);
      }
      ::_exit(run(words).exit_code);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WEXITSTATUS(status);
  };
  const std::vector<std::string> withdraw = {"store", "withdraw",   "x", "--reason",
                                             "y",     "--operator", "z", "--store"};
  for (const char* name : {"a.db", "locked/a.db"}) {
    auto words = withdraw;
    words.push_back(path(name));
    EXPECT_EQ(as_nobody(words), 77) << name;
  }
  EXPECT_EQ(as_nobody({"store", "import", path("none"), "--store", path("locked/b.db")}), 66);
  std::filesystem::permissions(folder_.path(), std::filesystem::perms(0755));
  std::filesystem::permissions(path("locked"), std::filesystem::perms(0755));
}

constexpr const char* kDevice =
    "virtual:seed=7,serial=MOS2A45130007,firmware=1.5.0,calibrated=2013-11-12,jig=auto";

TEST_F(StoreCommandTest, AJigRunIsStoredWithWhatItWasJudgedBy) {
  const auto jig = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"jig",     "--device",   kDevice,      "--jig",
                                      "virtual", "--operator", "Ada",        "--jig-id",
                                      "J-17",    "--store",    path("a.db"), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  };
  EXPECT_EQ(jig({"--retest-of", "last"}).exit_code, 66) << "there is none yet";
  const auto first = jig({"--jig-due", "2027-03-31"});
  EXPECT_EQ(first.exit_code, 0) << first.people;
  EXPECT_EQ(first.json()["kept"]["in"], "store");
  const auto second = jig({"--jig-due", "2001-01-01", "--retest-of", "last", "--write"});
  EXPECT_EQ(second.exit_code, 0) << second.people;
  EXPECT_THAT(second.people, HasSubstr("2001-01-01"));
  EXPECT_EQ(jig({"--jig-due", "soon"}).exit_code, 64);
  EXPECT_EQ(jig({"--retest-of", "no such run"}).exit_code, 66);
  EXPECT_EQ(jig({"--operator", std::string(300, 'x')}).exit_code, 64) << "given twice";
  EXPECT_EQ(jig({"--station", std::string(300, 'x')}).exit_code, 65)
      << "refused before anything is measured";

  const auto history = run({"history", "MOS2A45130007", "--store", path("a.db"), "--json"}).json();
  ASSERT_EQ(history["runs"].size(), 2U);
  const auto& run_1 = history["runs"][0];
  const auto& run_2 = history["runs"][1];
  EXPECT_EQ(run_1["id"], first.json()["run"]);
  EXPECT_EQ(run_1["jig"], "J-17");
  EXPECT_EQ(run_1["jig_due"], "2027-03-31T00:00:00Z");
  EXPECT_EQ(run_1["software"], station::software_name());
  EXPECT_EQ(run_1["build"], station::software_build().empty()
                                ? cli::Json(nullptr)
                                : cli::Json(station::software_build()));
  EXPECT_EQ(run_1["limits"]["limits"]["verification_residual_mg"]["high"], 10);
  EXPECT_EQ(run_1["limits_sha256"], run_2["limits_sha256"]);
  EXPECT_EQ(run_1["limits_sha256"], station::default_limits().sha256);
  EXPECT_TRUE(run_1["temperature_c"].is_number());
  EXPECT_TRUE(run_1["retest_of"].is_null());
  EXPECT_EQ(run_2["retest_of"], run_1["id"]);
  EXPECT_EQ(history["constants"][0]["run"], run_1["id"]);
  EXPECT_EQ(history["constants"][0]["id"], first.json()["stored_id"]);
  ASSERT_EQ(history["writes"].size(), 1U);
  EXPECT_EQ(history["writes"][0]["run"], run_2["id"]);
  EXPECT_EQ(history["writes"][0]["as_left"], history["writes"][0]["read_back"]);
  const auto of_jig = run({"store", "jig", "J-17", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(of_jig["units"][0]["runs"], 2);
  const auto yield = run({"store", "yield", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(yield["retests"], 1);
  EXPECT_EQ(yield["units"], 1);
}

// Runs the jig on a store that refuses; what was measured must be in the journal, and in the store
// once that is as it should be.
class RefusingStore : public StoreCommandTest {
 protected:
  RefusingStore() { ::setenv("XDG_DATA_HOME", (folder_ / "data").c_str(), 1); }
  ~RefusingStore() override { ::unsetenv("XDG_DATA_HOME"); }
  tests::Answer jig(const std::string& store) {
    return run({"jig", "--device", kDevice, "--jig", "virtual", "--store", store, "--json"});
  }
  void expect_in_journal(const std::string& store, const tests::Answer& answer) {
    const auto json = answer.json();
    EXPECT_EQ(json["verdict"], "pass");
    EXPECT_EQ(json["kept"]["in"], "journal") << answer.people;
    EXPECT_EQ(json["kept"]["folder"], cli::journal_folder(store));
    auto journal = db::Journal::open(posix_env().files, cli::journal_folder(store)).value();
    EXPECT_GE(journal.pending().value(), 2U) << "the run and its constants";
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
  EXPECT_EQ(history["constants"][0]["id"], missing.json()["stored_id"]);
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

// The store is there when the files are mended, and gone or damaged when it should be told.
TEST_F(RefusingStore, ARepairThatTheStoreDoesNotTakeIsJournalledAndResumedOnce) {
  const std::string store = path("a.db");
  EXPECT_EQ(jig(store).exit_code, 0);
  std::filesystem::create_directory(path("archive"));
  for (const char* name : {"a", "b"}) {
    std::ofstream(path("s.json")) << R"({"schema": "sixpoint/scenario/1", "seed": )"
                                  << (name[0] - 'a') << R"(, "unit": {
        "serial": "MOS2A45130007", "firmware": "1.5.0", "calibrated": "2013-11-12T14:32:13Z"},
        "motions": [{"kind": "free_living", "duration_s": 900}]})";
    ASSERT_EQ(run({"simulate", "--scenario", path("s.json"), "-o",
                   path(std::string("archive/") + name + ".gt3x")})
                  .exit_code,
              0);
  }
  const auto repair = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"repair",  path("archive"), "-o",    path("mended"),
                                      "--store", store,           "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  };
  // Somebody else's statement in front of it: the store refuses every repair.
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
  // Again: what the store knows is not told twice.
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
  const auto capture = run({"capture", "--device", kDevice, "--jig", "virtual", "-o",
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
  std::filesystem::create_directory("none");
  const auto in_place = jig("none/store.db");  // makes the store
  EXPECT_EQ(in_place.exit_code, 0) << in_place.people;
  EXPECT_EQ(run({"store", "catch-up", "--journal", folder, "--store", "none/store.db", "--json"})
                .json()["taken"],
            2);
  EXPECT_EQ(
      run({"store", "catch-up", "--journal", "no-folder", "--store", "none/store.db"}).exit_code,
      66);
  std::filesystem::current_path(before);
}

// Root of a container without that right may not mount anything: a skip, in CI as well. Whatever
// else goes wrong is a failure.
#define NEEDS_DISK(at, size)                                                \
  if (::mount("none", (at).c_str(), "tmpfs", 0, size) != 0) {               \
    ASSERT_TRUE(errno == EPERM || errno == EACCES) << std::strerror(errno); \
    GTEST_SKIP() << "SKIPPED: mounting a small disk needs CAP_SYS_ADMIN: "  \
                 << std::strerror(errno);                                   \
  }                                                                         \
  static_assert(true)

TEST_F(RefusingStore, AFullDiskLosesNoRun) {
  const std::string mount = path("small");
  std::filesystem::create_directory(mount);
  NEEDS_DISK(mount, "size=300k");
  const auto answer = jig(mount + "/a.db");
  ::umount(mount.c_str());
  EXPECT_EQ(answer.exit_code, 74) << answer.people;
  expect_in_journal(mount + "/a.db", answer);
}

TEST_F(RefusingStore, AReadOnlyDiskLosesNoRun) {
  const std::string mount = path("disc");
  std::filesystem::create_directory(mount);
  NEEDS_DISK(mount, "size=4m");
  fill("disc/a.db");
  ASSERT_EQ(::mount("none", mount.c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, ""), 0);
  const auto units = run({"units", "--store", mount + "/a.db"});
  const auto answer = jig(mount + "/a.db");
  ::umount(mount.c_str());
  EXPECT_EQ(units.exit_code, 77) << units.people;
  EXPECT_EQ(answer.exit_code, 77) << answer.people;
  expect_in_journal(mount + "/a.db", answer);
}

TEST_F(StoreCommandTest, AJigRunIsKeptInTheJournalWhileTheServerIsAway) {
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
