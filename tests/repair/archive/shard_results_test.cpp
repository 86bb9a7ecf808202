#include "repair/archive/shard_results.h"

#include "repair/archive/archive_fixture.h"

namespace sixpoint::repair {
namespace {

TEST_F(HostilePlan, DamagedResultsAreRunAgain) {
  ASSERT_OK(run_first());
  const std::string good = text("/plan/results/00000.jsonl");
  Random random(1);
  for (int trial = 0; trial < 60; ++trial) {
    std::string bad = good;
    if (trial % 2 == 0) {
      bad.resize(random.below(good.size()));
    } else {
      bad[random.below(good.size())] ^= static_cast<char>(1U << random.below(7));
    }
    replace("/plan/results/00000.jsonl", bad);
    const auto read = read_result(memory_.files, "/plan", plan_, 0);
    if (read) {  // only the header's words for people may differ
      EXPECT_EQ(read->files.size(), plan_.shards[0].files);
      continue;
    }
    EXPECT_EQ(standing_of(memory_.files, "/plan", plan_, 0).state, ShardState::damaged);
    ASSERT_OK(run_first());
    EXPECT_OK(read_result(memory_.files, "/plan", plan_, 0)) << "trial " << trial;
  }
}

TEST_F(HostilePlan, AResultComesBackFileByFile) {
  const auto ran = run_first();
  ASSERT_OK(ran);
  const auto read = read_result(memory_.files, "/plan", plan_, 0);
  ASSERT_OK(read);
  ASSERT_EQ(read->files.size(), ran->files.size());
  EXPECT_EQ(read->output_folder, "/repaired");
  for (std::size_t i = 0; i < ran->files.size(); ++i) {
    EXPECT_EQ(read->files[i].input, ran->files[i].input);
    EXPECT_EQ(read->files[i].to_json(), ran->files[i].to_json());
    EXPECT_EQ(read->files[i].repaired_at, ran->files[i].repaired_at);
  }
  EXPECT_FAILS(read_result(memory_.files, "/plan", plan_, 1), ErrorCode::no_input);
  EXPECT_FAILS(read_result(memory_.files, "/plan", plan_, 2), ErrorCode::usage);
  EXPECT_EQ(to_string(standing_of(memory_.files, "/plan", plan_, 1).state), "missing");
}

}  // namespace
}  // namespace sixpoint::repair
