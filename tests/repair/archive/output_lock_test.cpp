#include "repair/archive/output_lock.h"

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::repair {
namespace {

constexpr const char* kPlanId = "0123456789abcdef0123";
constexpr const char* kOtherPlanId = "fedcba98765432100123";

class OutputLock : public testing::Test {
 protected:
  // Null: refused. There are locks here.
  static std::unique_ptr<FileLock> answer(Result<std::unique_ptr<FileLock>> lock) {
    if (!lock) {
      EXPECT_FAILS(lock, ErrorCode::cannot_create);
      return nullptr;
    }
    EXPECT_NE(*lock, nullptr);
    return *std::move(lock);
  }
  std::unique_ptr<FileLock> of_repair() { return answer(lock_for_repair(memory_.files, "out")); }
  std::unique_ptr<FileLock> of_shard(std::size_t shard, const char* plan = kPlanId) {
    return answer(lock_for_shard(memory_.env, "out", plan, shard));
  }

  MemoryEnv memory_;
};

TEST_F(OutputLock, WhereRepairIsAtWorkNoOtherBegins) {
  const auto at_work = of_repair();
  ASSERT_NE(at_work, nullptr);
  EXPECT_EQ(of_repair(), nullptr);
  EXPECT_EQ(of_shard(0), nullptr);
}

TEST_F(OutputLock, WhereAShardIsAtWorkOtherShardsBeginAndRepairDoesNot) {
  auto first = of_shard(0);
  ASSERT_NE(first, nullptr);
  auto second = of_shard(1);
  ASSERT_NE(second, nullptr);
  EXPECT_NE(of_shard(0, kOtherPlanId), nullptr) << "of another plan";
  EXPECT_EQ(of_repair(), nullptr);
  first.reset();
  EXPECT_EQ(of_repair(), nullptr) << "the other one is at work";
  second.reset();
  EXPECT_NE(of_repair(), nullptr);
}

// The commands refuse such a folder by their own rule (cli/output.h), the others by this one.
TEST_F(OutputLock, ABundleAndAPlanAreNoOutputFolders) {
  ASSERT_OK(memory_.files.make_folders("out"));
  ASSERT_OK(write_file(memory_.files, "out/protocol.json", R"({"schema": "sixpoint/bundle/1"})"));
  EXPECT_EQ(of_repair(), nullptr);
  EXPECT_EQ(of_shard(0), nullptr);
  ASSERT_OK(memory_.files.remove("out/protocol.json"));
  ASSERT_OK(write_file(memory_.files, "out/plan.json", R"({"schema": "sixpoint/archive-plan/1"})"));
  EXPECT_EQ(of_repair(), nullptr);
  EXPECT_EQ(of_shard(0), nullptr);
  EXPECT_EQ(memory_.files.list("out").value(), std::vector<std::string>{"plan.json"});
}

TEST_F(OutputLock, OfAShardNothingStaysNotEvenWhatAKilledOneLeft) {
  ASSERT_NE(of_shard(3), nullptr);
  EXPECT_TRUE(memory_.files.list("out").value().empty());
  ASSERT_OK(write_file(memory_.files, "out/.sixpoint-shard-0123456789abcdef-00007.lock", ""));
  EXPECT_NE(of_repair(), nullptr);
  EXPECT_EQ(memory_.files.list("out").value(), std::vector<std::string>{".sixpoint-repair.lock"});
  EXPECT_NE(of_shard(7), nullptr) << "the file of a repair that ended is in no one's way";
}

}  // namespace
}  // namespace sixpoint::repair
