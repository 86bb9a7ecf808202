#include "repair/archive/archive_plan.h"

#include <filesystem>

#include "repair/archive/archive_fixture.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

TEST_F(Archive, CutsShardsAsEvenlyAsTheFilesAllow) {
  Random random(8);
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<std::uint64_t> bytes(1 + random.below(12));
    for (auto& size : bytes) {
      size = random.below(4) == 0 ? random.below(1000) : random.below(20);
    }
    const std::size_t shards = 1 + random.below(bytes.size() + 2);
    const auto ends = cut_into_shards(bytes, shards);
    ASSERT_EQ(ends.size(), std::min(shards, bytes.size()));
    ASSERT_EQ(ends.back(), bytes.size());
    const auto largest = [&](const std::vector<std::size_t>& cuts) {
      std::uint64_t most = 0;
      std::size_t from = 0;
      for (const std::size_t to : cuts) {
        most = std::max(most, std::accumulate(bytes.begin() + static_cast<std::ptrdiff_t>(from),
                                              bytes.begin() + static_cast<std::ptrdiff_t>(to),
                                              std::uint64_t{0}));
        from = to;
      }
      return most;
    };
    for (std::size_t k = 0; k < ends.size(); ++k) {
      EXPECT_LT(k == 0 ? 0 : ends[k - 1], ends[k]) << "no shard is empty";
    }
    // Oracle: every way to cut.
    std::uint64_t best = ~0ULL;
    for (unsigned mask = 0; mask < 1U << (bytes.size() - 1); ++mask) {
      std::vector<std::size_t> cuts;
      for (std::size_t i = 1; i < bytes.size(); ++i) {
        if ((mask >> (i - 1) & 1U) != 0) {
          cuts.push_back(i);
        }
      }
      cuts.push_back(bytes.size());
      if (cuts.size() <= shards) {
        best = std::min(best, largest(cuts));
      }
    }
    EXPECT_EQ(largest(ends), best);
  }
}

TEST_F(Archive, AFileIsPlannedOnceByWhateverRootsItIsFound) {
  namespace fs = std::filesystem;
  const sixpoint::tests::TemporaryFolder folder;
  Env& env = posix_env();
  fs::create_directories(folder / "tree/sub");
  Random random(1);
  ASSERT_OK(few_seconds(random).write(env.files, folder / "tree/a.gt3x"));
  ASSERT_OK(few_seconds(random).write(env.files, folder / "tree/sub/b.gt3x"));
  fs::create_symlink("nowhere", folder / "tree/sub/none.gt3x");
  fs::create_directory_symlink(folder / "tree", folder / "other-name");
  const auto outputs = [&](const std::vector<std::string>& paths) {
    ArchiveDraft how = draft(1);
    how.paths = paths;
    const auto planned = plan_archive(env, how);
    EXPECT_OK(planned);
    std::vector<std::string> names;
    for (const ArchiveFile& file : planned->files) {
      names.push_back(file.relative);
    }
    EXPECT_EQ(planned->plan.refused.size(), 1U) << "the link that leads nowhere";
    return names;
  };
  const std::string tree = folder / "tree";
  EXPECT_THAT(outputs({tree, tree + "/sub"}), testing::ElementsAre("a.gt3x", "sub/b.gt3x"));
  EXPECT_THAT(outputs({tree + "/sub", tree}), testing::ElementsAre("b.gt3x", "a.gt3x"));
  EXPECT_THAT(outputs({tree, tree + "/./sub/../sub/b.gt3x", folder / "other-name"}),
              testing::ElementsAre("a.gt3x", "sub/b.gt3x"));
}

TEST_F(Archive, AFolderWithoutRecordingsAndTooManyShardsAreRefused) {
  MemoryEnv memory;
  ASSERT_OK(memory.files.make_folders("/archive"));
  EXPECT_FAILS(plan_archive(memory.env, draft(1)), ErrorCode::no_input);
  fill(memory.files, 1, 3);
  auto none = draft(1);
  none.paths = {"/none"};
  EXPECT_FAILS(plan_archive(memory.env, none), ErrorCode::no_input);
  const auto planned = plan_archive(memory.env, draft(kMostShards + 1));
  ASSERT_OK(planned);
  EXPECT_EQ(planned->plan.shards.size(), 3U) << "no more shards than files";
  EXPECT_EQ(planned->plan.files(), 3U);
}

}  // namespace
}  // namespace sixpoint::repair
