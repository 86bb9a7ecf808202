#include "repair/archive/archive_scripts.h"

#include "repair/archive/archive_fixture.h"

namespace sixpoint::repair {
namespace {

TEST_F(Archive, ScriptsKeepAnyFolderOneWord) {
  EXPECT_EQ(shell_word("/plain/path-1.2"), "/plain/path-1.2");
  EXPECT_EQ(shell_word(""), "''");
  EXPECT_EQ(shell_word("it's; rm -rf $HOME\n"), "'it'\\''s; rm -rf $HOME\n'");
  const std::string script = slurm_script({"/p", "sixpoint", 12, 5});
  EXPECT_THAT(script, HasSubstr("#SBATCH --array=0-11%5\n"));
  EXPECT_THAT(slurm_script({"/p", "sixpoint", 12, 0}), HasSubstr("#SBATCH --array=0-11\n"));
  const std::string odd = "/it's; rm -rf $HOME";
  EXPECT_THAT(merge_script({odd, "sixpoint", 12, 0}), HasSubstr("plan=" + shell_word(odd) + "\n"));
  EXPECT_THAT(merge_script({"/p", odd, 12, 0}),
              HasSubstr("program=${SIXPOINT:-" + shell_word(odd) + "}\n"));
}

TEST_F(Archive, TheMergeWaitsForTheArrayHoweverItEnds) {
  EXPECT_THAT(array_command("/p q", "/out", {"--partition=long"}),
              testing::ElementsAre("sbatch", "--parsable", "--output=/p q/results/slurm-%A-%a.log",
                                   "--partition=long", "/p q/run.sbatch", "/out"));
  EXPECT_THAT(merge_command("/p", "123", {}),
              testing::ElementsAre("sbatch", "--parsable", "--dependency=afterany:123",
                                   "--output=/p/merge.log", "/p/merge.sbatch"));
}

// Measured: 343 MB with 60,000 files.
TEST_F(Archive, TheMergeAsksForMemoryByTheNumberOfFiles) {
  const auto asked = [](std::size_t files) {
    return merge_script({"/p", "sixpoint", 12, 0, files});
  };
  EXPECT_THAT(asked(1), HasSubstr("#SBATCH --mem=1024M\n"));
  EXPECT_THAT(asked(60'000), HasSubstr("#SBATCH --mem=1024M\n"));
  EXPECT_THAT(asked(180'000), HasSubstr("#SBATCH --mem=2056M\n"));
  EXPECT_THAT(asked(1'000'000), HasSubstr("#SBATCH --mem=10256M\n"));
}

}  // namespace
}  // namespace sixpoint::repair
