#include "repair/archive/archive_merge.h"

#include "repair/archive/archive_fixture.h"

namespace sixpoint::repair {
namespace {

TEST_F(HostilePlan, VerifyFindsAnOutputThatWasTouched) {
  ASSERT_OK(run_first());
  const auto result = read_result(memory_.files, "/plan", plan_, 0);
  ASSERT_OK(result);
  const auto repaired_file =
      std::find_if(result->files.begin(), result->files.end(),
                   [](const auto& report) { return report.status == RepairStatus::repaired; });
  ASSERT_NE(repaired_file, result->files.end());
  replace(repaired_file->output, "touched");
  MergeOptions options;
  const auto blind = merge_archive(memory_.files, "/plan", plan_, options);
  ASSERT_OK(blind);
  options.verify = true;
  const auto merged = merge_archive(memory_.files, "/plan", plan_, options);
  ASSERT_OK(merged);
  EXPECT_EQ(merged->shards[0].failed, blind->shards[0].failed + 1);
}

TEST_F(HostilePlan, AMergeNamesTheShardsThatAreMissing) {
  ASSERT_OK(run_first());
  const auto merged = merge_archive(memory_.files, "/plan", plan_, {});
  ASSERT_OK(merged);
  EXPECT_FALSE(merged->complete());
  EXPECT_EQ(merged->files_missing(), plan_.shards[1].files);
  EXPECT_EQ(merged->shards[0].state, ShardState::done);
  EXPECT_EQ(merged->shards[1].state, ShardState::missing);
}

}  // namespace
}  // namespace sixpoint::repair
