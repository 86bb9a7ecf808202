// sixpoint store ... by its contract, on the real disk.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/env.h"
#include "db/journal.h"
#include "db/store.h"
#include "expect_result.h"
#include "run_command.h"
#include "station/cli/store_option.h"
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
