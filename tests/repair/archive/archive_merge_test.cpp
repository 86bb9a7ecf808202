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
  EXPECT_EQ(merged->shards[0].touched, 1U);
  ASSERT_OK(memory_.files.remove(repaired_file->output));
  const auto removed = merge_archive(memory_.files, "/plan", plan_, options);
  ASSERT_OK(removed);
  EXPECT_EQ(removed->shards[0].failed, blind->shards[0].failed + 1);
  EXPECT_EQ(removed->shards[0].touched, 0U) << "a run makes it anew";
}

// The table of archive_merge.h, row by row.
TEST(MergedShard, WantsARerunByTheTable) {
  MergedShard shard;
  shard.state = ShardState::missing;
  EXPECT_TRUE(shard.wants_rerun());
  shard.state = ShardState::running;
  EXPECT_FALSE(shard.wants_rerun()) << "it would be refused";
  shard.state = ShardState::partly;
  EXPECT_TRUE(shard.wants_rerun());
  shard.plan_damaged = true;
  EXPECT_FALSE(shard.wants_rerun());
  shard = {};
  shard.state = ShardState::done;
  EXPECT_FALSE(shard.wants_rerun()) << "nothing failed";
  shard.failed = 3;
  EXPECT_TRUE(shard.wants_rerun());
  shard.changed = 2;
  EXPECT_TRUE(shard.wants_rerun());
  shard.touched = 1;
  EXPECT_FALSE(shard.wants_rerun());
  shard.failed = 1;
  shard.changed = 0;
  EXPECT_FALSE(shard.wants_rerun());
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
