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

// The names of a plan are any bytes; those of JSON are not.
TEST_F(Archive, ALinkOfAnyNameComesBackAsItWas) {
  MemoryEnv memory;
  Random random(1);
  MadeRecording sound = few_seconds(random);
  sound.firmware = "1.8.0";
  ASSERT_OK(memory.files.make_folders("/archive"));
  ASSERT_OK(sound.write(memory.files, "/archive/\xff\xfe.gt3x"));
  ArchiveDraft how = draft(1);
  how.repair.link_unaffected = LinkKind::hard;
  const auto planned = plan(memory, how);
  ASSERT_OK(planned);
  ShardRunOptions options = shard(0);
  int made = 0;
  options.make_link = [&](const std::string& from, const std::string& to, LinkKind) -> Status {
    ++made;
    SIXPOINT_ASSIGN(const Bytes bytes, read_file(memory.files, from));
    SIXPOINT_ASSIGN(const auto file, memory.files.create(to));
    return file->write_at(0, bytes);
  };
  ASSERT_OK(run_shard(memory.env, "/plan", planned->plan, options));
  const auto read = read_result(memory.files, "/plan", planned->plan, 0);
  ASSERT_OK(read);
  EXPECT_EQ(read->files.at(0).linked, "/repaired/\xff\xfe.gt3x");
  const auto again = run_shard(memory.env, "/plan", planned->plan, options);
  ASSERT_OK(again);
  EXPECT_EQ(again->done_before, 1U);
  EXPECT_EQ(made, 1) << "what is done is not done again";
}

}  // namespace
}  // namespace sixpoint::repair
