// sixpoint store ... by its contract, on the real disk.
#include <filesystem>
#include <fstream>

#include "cli/command_fixture.h"

namespace sixpoint {
namespace {

using testing::HasSubstr;
using tests::StoreTest;

TEST_F(StoreTest, ExportImportAndBackupKeepTheHead) {
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
  const auto csv = run({"store", "import", path("csv"), "--store", path("e.db")});
  EXPECT_EQ(csv.exit_code, 65);
  EXPECT_THAT(csv.people, HasSubstr("without --csv"));
  EXPECT_FALSE(std::filesystem::exists(path("e.db")));
}

TEST_F(StoreTest, WithdrawnConstantsRecallTheirFiles) {
  const std::string id = fill("a.db");
  EXPECT_EQ(run({"store", "recall", "--store", path("a.db"), "--json"}).json()["files"].size(), 0U);
  EXPECT_THAT(run({"store", "recall", "--store", path("a.db")}).people,
              HasSubstr("no file was repaired with constants that were withdrawn"));
  EXPECT_EQ(run({"store", "due", "--days", "30000", "--store", path("a.db")}).people,
            "no unit is due\n");
  EXPECT_EQ(run({"store", "withdraw", id, "--store", path("a.db")}).exit_code, 64) << "no reason";
  const auto withdrawn = run({"store", "withdraw", id, "--reason", "out of level", "--operator",
                              "Ada", "--store", path("a.db"), "--json"});
  EXPECT_EQ(withdrawn.json()["recall"], 1);
  const auto recall = run({"store", "recall", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(recall["files"][0]["input"], "a.gt3x");
  EXPECT_EQ(recall["files"][0]["reason"], "out of level");
  EXPECT_TRUE(recall["files"][0]["repaired_again_at"].is_null());
  const auto trend = run({"store", "trend", "MOS2A1", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(trend["points"][0]["withdrawn"], true);
  EXPECT_EQ(trend["points"][0]["constants"]["zero_lsb"][2], 3);
  const auto due = run({"store", "due", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(due["units"][0]["serial"], "MOS2A1");
  EXPECT_EQ(run({"store", "due", "--store", path("a.db")}).people, "");
  EXPECT_TRUE(due["units"][0]["last_constants"].is_null()) << "the only set was withdrawn";
  const auto yield = run({"store", "yield", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(yield["units"], 0);
  EXPECT_TRUE(yield["yield"].is_null());
  EXPECT_EQ(run({"store", "yield", "--from", "May", "--store", path("a.db")}).exit_code, 64);
  EXPECT_EQ(run({"store", "trend", "MOS2A2", "--store", path("a.db")}).exit_code, 66);
}

TEST_F(StoreTest, CorrectionsAreSaidWithTheirReason) {
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
  EXPECT_EQ(correct({"reinstate", id, "--reason", "x"}), 78) << "they apply";
  EXPECT_EQ(correct({"withdraw", id, "--reason", "wrong jig"}), 0);
  EXPECT_EQ(correct({"withdraw", id, "--reason", "wrong jig"}), 78) << "done already";
  EXPECT_EQ(constants()["withdrawn"], true);
  EXPECT_EQ(correct({"reinstate", id, "--reason", "it was right"}), 0);
  EXPECT_EQ(constants()["withdrawn"], false);
  EXPECT_EQ(correct({"note", "units", "MOS2A1", "--reason", "came back twice"}), 0);
  EXPECT_EQ(correct({"note", "units", "MOS2A1"}), 64);
  EXPECT_EQ(correct({"note", "units", "MOS2A2", "--reason", "x"}), 66);
  EXPECT_EQ(correct({"note", "nothing", "MOS2A1", "--reason", "x"}), 64);
  const auto history = run({"history", "MOS2A1", "--store", path("a.db"), "--json"}).json();
  ASSERT_EQ(history["corrections"].size(), 3U);
  EXPECT_EQ(history["corrections"][2]["about"]["table"], "units");
  EXPECT_EQ(history["corrections"][2]["reason"], "came back twice");
  EXPECT_EQ(history["repairs"][0]["input"], "a.gt3x");
}

// As 'scan' and 'inspect' take it.
TEST_F(StoreTest, AUnitIsFoundInSmallLettersToo) {
  fill("a.db");
  const auto add = [&](const std::string& serial) {
    auto store = db::Store::open(posix_env(), path("a.db")).value();
    db::ConstantsRecord record;
    record.serial = serial;
    record.filter = "current";
    record.made_at = from_unix_seconds(2000);
    record.document = "{}";
    EXPECT_OK(store.add_constants(record, "w"));
  };
  add("MOS2A45130007");
  for (const char* serial : {"mos2a45130007", "MOS2A45130007"}) {
    const auto history = run({"history", serial, "--store", path("a.db"), "--json"});
    EXPECT_EQ(history.exit_code, 0) << history.people;
    EXPECT_EQ(history.json()["serial"], "MOS2A45130007");
    const auto trend = run({"store", "trend", serial, "--store", path("a.db"), "--json"});
    EXPECT_EQ(trend.exit_code, 0) << trend.people;
    EXPECT_EQ(trend.json()["serial"], "MOS2A45130007");
    const auto note = run(
        {"store", "note", "units", serial, "--why", "cracked", "--store", path("a.db"), "--json"});
    EXPECT_EQ(note.exit_code, 0) << note.people;
    EXPECT_EQ(note.json()["about"]["id"], "MOS2A45130007");
  }
  add("mos2a45130008");
  const auto stored = run({"history", "mos2a45130008", "--store", path("a.db"), "--json"});
  EXPECT_EQ(stored.json()["serial"], "mos2a45130008") << "a store that has it so";
  EXPECT_EQ(run({"history", "mos2a45130009", "--store", path("a.db")}).exit_code, 66);
}

// Stores that cannot be used: the exit code of the contract, and a message that names the place.
TEST_F(StoreTest, StoresThatCannotBeUsedAreNamedWithTheirReason) {
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

TEST_F(StoreTest, AFileOrFolderThatMayNotBeWrittenIsSaidSo) {
  fill("a.db");
  std::filesystem::create_directory(path("locked"));
  std::filesystem::copy_file(path("a.db"), path("locked/a.db"));
  std::filesystem::permissions(path("a.db"), std::filesystem::perms(0444));
  std::filesystem::permissions(path("locked/a.db"), std::filesystem::perms(0444));
  std::filesystem::permissions(path("locked"), std::filesystem::perms(0555));
  std::filesystem::permissions(folder_.path(), std::filesystem::perms(0555));
  const auto as_other_user = [&](const std::vector<std::string>& words) {
    return tests::exit_code_as_other_user(words, folder_.path());
  };
  for (const char* correction : {"withdraw", "reinstate", "prefer"}) {
    for (const char* name : {"a.db", "locked/a.db"}) {
      EXPECT_EQ(as_other_user({"store", correction, "x", "--reason", "y", "--operator", "z",
                               "--store", path(name)}),
                77)
          << correction << " " << name;
    }
  }
  EXPECT_EQ(as_other_user({"store", "backup", "--store", path("a.db"), "-o", path("locked/b.db")}),
            77);
  EXPECT_EQ(as_other_user({"store", "import", path("none"), "--store", path("locked/b.db")}), 66);
  std::filesystem::permissions(folder_.path(), std::filesystem::perms(0755));
  std::filesystem::permissions(path("locked"), std::filesystem::perms(0755));
}

}  // namespace
}  // namespace sixpoint
