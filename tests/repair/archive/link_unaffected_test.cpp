#include "repair/archive/link_unaffected.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "expect_result.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

const LinkMaker kMake = [](const auto& from, const auto& to, LinkKind kind) {
  return link_file(from, to, kind);
};

TEST(LinkUnaffected, FollowsTheTable) {
  RepairReport report;
  for (const auto& [status, linked] :
       {std::pair(RepairStatus::not_affected, true),
        std::pair(RepairStatus::already_repaired, true), std::pair(RepairStatus::repaired, false),
        std::pair(RepairStatus::not_repairable, false), std::pair(RepairStatus::outdated, false),
        std::pair(RepairStatus::failed, false)}) {
    report.status = status;
    EXPECT_EQ(is_linked(report), linked) << to_string(status);
  }
  report.status = RepairStatus::not_affected;
  report.output = "out.gt3x";
  EXPECT_FALSE(is_linked(report)) << "it was written, by --salvage";
}

TEST(LinkUnaffected, MakesALinkOnceAndReplacesNothing) {
  const tests::TemporaryFolder folder;
  const std::string input = folder / "in.gt3x";
  std::ofstream(input) << "recording";
  for (const LinkKind kind : {LinkKind::hard, LinkKind::symbolic}) {
    RepairReport report;
    report.input = input;
    report.status = RepairStatus::not_affected;
    const std::string output = folder / std::string(to_string(kind)) + "/a/b/in.gt3x";
    link_unaffected(posix_env().files, kMake, kind, output, report);
    EXPECT_EQ(report.status, RepairStatus::not_affected);
    EXPECT_EQ(report.linked, output);
    EXPECT_TRUE(std::filesystem::equivalent(input, output));
    EXPECT_EQ(std::filesystem::is_symlink(output), kind == LinkKind::symbolic);
    link_unaffected(posix_env().files, kMake, kind, output, report);
    EXPECT_EQ(report.status, RepairStatus::not_affected) << "the same link again is no error";
    // Something else has the name.
    std::filesystem::remove(output);
    std::ofstream(output) << "mine";
    link_unaffected(posix_env().files, kMake, kind, output, report);
    EXPECT_EQ(report.status, RepairStatus::failed);
    ASSERT_TRUE(report.error);
    EXPECT_EQ(report.error->code, ErrorCode::cannot_create);
    std::string text;
    std::ifstream(output) >> text;
    EXPECT_EQ(text, "mine");
  }
}

TEST(LinkUnaffected, MakesNoneInADryRunOrWhenNotAskedFor) {
  const tests::TemporaryFolder folder;
  RepairReport report;
  report.input = folder / "in.gt3x";
  std::ofstream(report.input) << "recording";
  report.status = RepairStatus::not_affected;
  link_unaffected(posix_env().files, kMake, LinkKind::none, folder / "out/in.gt3x", report);
  report.dry_run = true;
  link_unaffected(posix_env().files, kMake, LinkKind::hard, folder / "out/in.gt3x", report);
  EXPECT_TRUE(report.linked.empty());
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

}  // namespace
}  // namespace sixpoint::repair
