// The rules that repair and archive share: which store is asked, which exit code a report has.
#include "cli/files/repair_answer.h"

#include <fstream>

#include <gmock/gmock.h>

#include "cli/command_fixture.h"
#include "expect_result.h"
#include "repair/jig_constants.h"

namespace sixpoint::cli {
namespace {

using tests::StoreTest;

class RepairAnswer : public StoreTest {
 protected:
  std::ostringstream out_;
  std::ostringstream people_;
  std::istringstream in_;
  Context context_{posix_env(), out_, people_, in_};
};

TEST_F(RepairAnswer, TheStoreByItsTable) {
  ::setenv("SIXPOINT_STORE", path("default.db").c_str(), 1);
  EXPECT_FALSE(store_of(context_, {}).value()) << "there is no default store yet";
  fill("default.db");
  fill("named.db");
  const std::string named = path("named.db");
  EXPECT_TRUE(store_of(context_, {}).value());
  EXPECT_FALSE(store_of(context_, {"", "", "", true}).value()) << "--scan alone";
  EXPECT_TRUE(store_of(context_, {"", "", "c.gt3x", true}).value()) << "a calibration file too";
  EXPECT_EQ(store_of(context_, {"", named, "", true}).value()->database().location(), named);
  EXPECT_FAILS(store_of(context_, {"", path("none.db"), "", false}), ErrorCode::no_input);
  ::unsetenv("SIXPOINT_STORE");
}

TEST_F(RepairAnswer, TheTallyKeepsTheWorstExitCode) {
  using repair::RepairStatus;
  RepairTally tally;
  const auto add = [&](RepairStatus status) {
    repair::RepairReport report;
    report.status = status;
    tally.add(context_, report);
    return context_.exit_code;
  };
  EXPECT_EQ(add(RepairStatus::repaired), 0);
  EXPECT_EQ(add(RepairStatus::not_affected), 0);
  EXPECT_EQ(add(RepairStatus::already_repaired), 0);
  EXPECT_EQ(add(RepairStatus::not_repairable), 1);
  EXPECT_EQ(add(RepairStatus::outdated), 1);
  tally.add(context_,
            failed_report("a.gt3x", {ErrorCode::io, "cannot be read", "a.gt3x", "retry"}));
  EXPECT_EQ(context_.exit_code, 74);
  EXPECT_EQ(add(RepairStatus::repaired), 74);
  EXPECT_EQ(tally.to_json(true), Json::parse(R"({"files": 7, "repaired": 2, "not_affected": 1,
      "not_repairable": 1, "already_repaired": 1, "outdated": 1, "failed": 1, "dry_run": true})"));
  EXPECT_EQ(tally.brief(true),
            "7 files: 2 repaired (dry run: nothing was written), 1 not affected, 1 already "
            "repaired, 1 not repairable, 1 outdated, 1 failed\n");
}

TEST_F(RepairAnswer, ConstantsThatCannotBeReadNameTheirFile) {
  std::ofstream(path("c.json")) << "{}";
  const auto read = read_constants(posix_env().files, path("c.json"));
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().where, path("c.json"));
  std::string two = tests::kConstants;
  const auto at = two.find("\"zero_lsb\"");
  ASSERT_NE(at, std::string::npos);
  two.replace(at, two.find(']', at) + 1 - at, "\"zero_lsb\": [1, 2]");
  std::ofstream(path("two.json")) << two;
  const auto key = read_constants(posix_env().files, path("two.json"));
  ASSERT_FALSE(key);
  EXPECT_EQ(key.error().brief(), path("two.json") +
                                     ": zero_lsb is not an array of three numbers, X Y Z; write "
                                     "the file with sixpoint");
}

// A parser would take one of the two without a word.
TEST_F(RepairAnswer, AKeyThatStandsTwiceInAConstantsFileIsRefused) {
  const std::string text = tests::kConstants;
  std::ofstream(path("once.json")) << text;
  ASSERT_OK(read_constants(posix_env().files, path("once.json")));
  std::ofstream(path("twice.json")) << R"({"filter": "legacy",)" << text.substr(text.find('{') + 1);
  const auto read = read_constants(posix_env().files, path("twice.json"));
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::bad_data);
  EXPECT_EQ(read.error().where, path("twice.json"));
  EXPECT_THAT(read.error().what, testing::HasSubstr("/filter"));
}

}  // namespace
}  // namespace sixpoint::cli
