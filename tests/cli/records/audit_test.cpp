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
  const std::string head = verify("").json()["head"];
  EXPECT_EQ(verify(head).exit_code, 0);
  EXPECT_EQ(verify(std::string(64, 'a')).exit_code, 1);
  EXPECT_EQ(verify("abc").exit_code, 64);
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

}  // namespace
}  // namespace sixpoint
