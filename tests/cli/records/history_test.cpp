// sixpoint history by its contract: the records of a run as the command shows them.
#include "cli/command_fixture.h"
#include "station/limits/limits.h"
#include "station/records/software.h"

namespace sixpoint {
namespace {

using testing::HasSubstr;
using tests::StoreTest;

TEST_F(StoreTest, AJigRunIsStoredWithWhatItWasJudgedBy) {
  const auto jig = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {
        "jig",      "--device", tests::kUnitInJig, "--jig",      "virtual", "--operator", "Ada",
        "--jig-id", "J-17",     "--store",         path("a.db"), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  };
  EXPECT_EQ(jig({"--retest-of", "last"}).exit_code, 66) << "there is none yet";
  const auto first = jig({"--jig-due", "2027-03-31"});
  EXPECT_EQ(first.exit_code, 0) << first.people;
  EXPECT_EQ(first.json()["kept"]["in"], "store");
  const auto second = jig({"--jig-due", "2001-01-01", "--jig-exception", "no other jig",
                           "--jig-exception-by", "Eve", "--retest-of", "last", "--write"});
  EXPECT_EQ(second.exit_code, 0) << second.people;
  EXPECT_THAT(second.people, HasSubstr("2001-01-01"));
  EXPECT_EQ(jig({"--jig-due", "soon"}).exit_code, 64);
  EXPECT_EQ(jig({"--retest-of", "no such run"}).exit_code, 66);
  EXPECT_EQ(jig({"--operator", std::string(300, 'x')}).exit_code, 64) << "given twice";
  EXPECT_EQ(jig({"--station", std::string(300, 'x')}).exit_code, 64)
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
  const auto text = run({"history", "MOS2A45130007", "--store", path("a.db")}).out;
  EXPECT_THAT(text, testing::StartsWith("when "));
  EXPECT_THAT(text, testing::ContainsRegex("run jig +pass +[0-9a-f]{12}  [0-9.]+ mg off .limit 10"))
      << "the value beside the verdict";
  EXPECT_THAT(text, HasSubstr(" LSB/g, zero "));
  EXPECT_THAT(text, testing::Not(testing::ContainsRegex("[0-9]\\.[0-9]{6,}Z"))) << "no nanoseconds";
  const auto trend = run({"store", "trend", "MOS2A45130007", "--store", path("a.db")}).out;
  EXPECT_THAT(trend, HasSubstr(" LSB/g, zero "));
  EXPECT_EQ(run({"store", "jig", "J-71", "--store", path("a.db")}).exit_code, 66);
  const auto of_jig = run({"store", "jig", "J-17", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(of_jig["units"][0]["runs"], 2);
  const auto yield = run({"store", "yield", "--store", path("a.db"), "--json"}).json();
  EXPECT_EQ(yield["retests"], 1);
  EXPECT_EQ(yield["units"], 1);
  EXPECT_EQ(yield["judged"], 1);
}

TEST_F(StoreTest, HistoryListsTheRecordsOfAUnit) {
  const std::string id = fill("a.db");
  const auto answer = run({"history", "MOS2A1", "--store", path("a.db"), "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const cli::Json json = answer.json();
  EXPECT_EQ(json["schema"], "sixpoint/history/1");
  ASSERT_EQ(json["constants"].size(), 1U);
  EXPECT_EQ(json["constants"][0]["id"], id);
  EXPECT_EQ(json["constants"][0]["made_at"], "1970-01-01T00:16:40Z");
  EXPECT_EQ(json["constants"][0]["constants"]["zero_lsb"], cli::Json::parse("[1,2,3]"));
  EXPECT_TRUE(json["constants"][0]["standard_uncertainty"].is_null());
  ASSERT_EQ(json["repairs"].size(), 1U);
  EXPECT_EQ(json["repairs"][0]["constants"], id);
  EXPECT_TRUE(json["runs"].empty());
  EXPECT_THAT(run({"history", "MOS2A1", "--store", path("a.db")}).out, HasSubstr("a.gt3x"));
  EXPECT_EQ(run({"history", "MOS2A2", "--store", path("a.db")}).exit_code, 66) << "unknown unit";
  EXPECT_EQ(run({"history", "MOS2A1", "--store", path("none.db")}).exit_code, 66);
  EXPECT_EQ(run({"history"}).exit_code, 64);
}

}  // namespace
}  // namespace sixpoint
