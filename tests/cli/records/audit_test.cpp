// sixpoint audit verify by its contract; store_test.cpp has stores that were changed.
#include <algorithm>
#include <fstream>
#include <iterator>

#include "cli/command_fixture.h"

namespace sixpoint {
namespace {

using testing::HasSubstr;
using tests::StoreTest;

TEST_F(StoreTest, AHeadThatWasWrittenDownMustBeInTheChain) {
  fill("a.db");
  const auto verify = [&](const std::string& head) {
    return run({"audit", "verify", "--store", path("a.db"), "--head", head, "--json"});
  };
  const std::string head =
      run({"audit", "verify", "--store", path("a.db"), "--json"}).json()["head"];
  EXPECT_EQ(verify(head).exit_code, 0);
  EXPECT_EQ(verify(std::string(64, 'a')).exit_code, 1);
  EXPECT_EQ(verify("abc").exit_code, 64);
  EXPECT_EQ(verify("").exit_code, 64) << "a variable of a script that is not set";
}

TEST_F(StoreTest, AuditVerifyAnswersWithRowsAndHead) {
  fill("a.db");
  const auto answer = run({"audit", "verify", "--store", path("a.db"), "--json"});
  EXPECT_EQ(answer.exit_code, 0);
  EXPECT_EQ(answer.json()["schema"], "sixpoint/audit/1");
  EXPECT_EQ(answer.json()["ok"], true);
  // Oracle: an export has one line per row, and one before them.
  ASSERT_EQ(run({"store", "export", "--store", path("a.db"), "-o", path("a.jsonl")}).exit_code, 0);
  std::ifstream lines(path("a.jsonl"));
  EXPECT_EQ(answer.json()["rows"], std::count(std::istreambuf_iterator<char>(lines), {}, '\n') - 1);
  EXPECT_EQ(answer.json()["head"].get<std::string>().size(), 64U);
  // A row that was changed is found; --json prints the document alone.
  statements("a.db", "DROP TRIGGER repairs_no_update; UPDATE repairs SET input = 'b.gt3x'");
  const auto changed = run({"audit", "verify", "--store", path("a.db"), "--json"});
  EXPECT_EQ(changed.exit_code, 1);
  EXPECT_EQ(changed.json()["ok"], false);
  const auto for_people = run({"audit", "verify", "--store", path("a.db")});
  EXPECT_EQ(for_people.exit_code, 1);
  EXPECT_THAT(for_people.people, HasSubstr("restore the last backup"));
  EXPECT_EQ(run({"audit"}).exit_code, 64);
  EXPECT_EQ(run({"audit", "verify", "--store", path("none.db")}).exit_code, 66);
}

// A head from any of them is one that verify finds again.
TEST_F(StoreTest, TheHeadIsInEveryPlaceThatIsHandedOut) {
  const auto jig = run({"jig", "--device", tests::kUnitInJig, "--store", path("a.db"),
                        "--certificate", path("c.json"), "--json"});
  ASSERT_EQ(jig.exit_code, 0) << jig.people;
  const auto head = run({"audit", "head", "--store", path("a.db"), "--json"});
  EXPECT_EQ(head.exit_code, 0);
  EXPECT_EQ(head.json()["schema"], "sixpoint/audit/1");
  const std::string hex = head.json()["head"];
  EXPECT_EQ(run({"audit", "head", "--store", path("a.db")}).out, hex + "\n");
  EXPECT_EQ(head.json()["rows"],
            run({"audit", "verify", "--store", path("a.db"), "--json"}).json()["rows"]);
  std::vector<std::string> heads = {hex};
  heads.push_back(run({"store", "backup", "--store", path("a.db"), "-o", path("b.db"), "--json"})
                      .json()["head"]);
  heads.push_back(run({"store", "export", "--store", path("a.db"), "-o", path("a.jsonl"), "--json"})
                      .json()["head"]);
  std::ifstream exported(path("a.jsonl"));
  std::string line;
  std::getline(exported, line);
  heads.push_back(nlohmann::json::parse(line)["head"]);
  EXPECT_EQ(heads[1], hex);
  EXPECT_EQ(heads[2], hex);
  EXPECT_EQ(heads[3], hex);
  std::ifstream certificate(path("c.json"));
  heads.push_back(nlohmann::json::parse(certificate)["head"]);
  EXPECT_NE(heads[4], hex) << "the run's own row is not the last one";
  // The store goes on; what was handed out holds.
  ASSERT_EQ(run({"station-lock", "sign", "--operator", "Ada", "--reason", "checked", "--store",
                 path("a.db")})
                .exit_code,
            0);
  for (const std::string& old : heads) {
    EXPECT_EQ(run({"audit", "verify", "--store", path("a.db"), "--head", old}).exit_code, 0) << old;
  }
  EXPECT_EQ(run({"audit", "head", "--store", path("none.db")}).exit_code, 66);
}

}  // namespace
}  // namespace sixpoint
