// An archive in shards against one `repair` of the same files, and with the power cut at every
// step.
#include "repair/archive/archive_run.h"

#include <array>
#include <filesystem>

#include <fcntl.h>
#include <sys/stat.h>

#include "repair/archive/archive_fixture.h"
#include "repair/archive/output_lock.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

TEST_F(Archive, EqualsOneRepairForRandomTreesAndShardCounts) {
  std::set<std::string> statuses;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Random random(seed, 1);
    const std::size_t count = 1 + random.below(20);
    MemoryEnv whole;
    fill(whole.files, seed, count);
    const Outcome expected = repaired(whole);
    ASSERT_EQ(expected.reports.size(), count);

    MemoryEnv memory;
    fill(memory.files, seed, count);
    const auto planned = plan(memory, draft(1 + random.below(7)));
    ASSERT_OK(planned);
    const auto read = read_plan(memory.files, "/plan");
    ASSERT_OK(read);
    // Any order of the tasks, some of them twice.
    std::vector<std::size_t> order(read->shards.size());
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t i = order.size(); i > 1; --i) {
      std::swap(order[i - 1], order[random.below(i)]);
    }
    order.push_back(order.front());
    for (const std::size_t number : order) {
      ASSERT_OK(run_shard(memory.env, "/plan", *read, shard(number)));
    }
    const Outcome got = merged(memory.files, *read);
    EXPECT_EQ(got.reports, expected.reports) << "seed " << seed;
    EXPECT_EQ(got.outputs, expected.outputs) << "seed " << seed;
    for (const auto& [input, text] : expected.reports) {
      statuses.insert(nlohmann::json::parse(text)["status"]);
    }
  }
  EXPECT_EQ(statuses,
            (std::set<std::string>{"repaired", "not_affected", "not_repairable", "failed"}))
      << "the trees must hold every kind of file";
}

TEST_F(Archive, APowerCutAtEveryStepOfAShardLosesAndDoublesNothing) {
  MemoryEnv whole;
  fill(whole.files, 11, 4);
  const Outcome expected = repaired(whole);
  ASSERT_GE(expected.outputs.size(), 2U);
  std::size_t cuts = 0;
  for (std::size_t stop = 0;; ++stop) {
    MemoryEnv memory;
    fill(memory.files, 11, 4);
    for (const auto& [input, text] : expected.reports) {  // the archive is on the medium
      if (auto file = memory.files.info(input); file) {
        ASSERT_OK(memory.files.sync_folder(folder_of(input)));
      }
    }
    std::map<std::string, Bytes> originals;
    for (const auto& [input, text] : expected.reports) {
      originals[input] = read_file(memory.files, input).value();
    }
    const auto planned = plan(memory, draft(1));
    ASSERT_OK(planned);
    memory.files.fail_after(stop);
    const auto first = run_shard(memory.env, "/plan", planned->plan, shard(0));
    memory.files.stop_failing();
    const bool survived =
        first && std::none_of(first->files.begin(), first->files.end(), [](const auto& report) {
          return report.error && report.error->code == ErrorCode::io;
        });
    memory.files.lose_power();
    const auto read = read_plan(memory.files, "/plan");
    ASSERT_OK(read);
    if (survived) {
      EXPECT_OK(read_result(memory.files, "/plan", *read, 0)) << "acknowledged, then lost";
    }
    // Broken recordings of the tree were never synced: their bytes are gone with the power.
    for (const auto& [input, bytes] : originals) {
      if (bytes.size() > 6) {
        EXPECT_EQ(read_file(memory.files, input).value(), bytes);
      }
    }
    const auto second = run_shard(memory.env, "/plan", *read, shard(0));
    ASSERT_OK(second);
    const Outcome got = merged(memory.files, *read);
    EXPECT_EQ(got.outputs, expected.outputs) << "stopped at " << stop;
    for (const auto& [input, text] : expected.reports) {
      if (originals[input].size() > 6) {
        EXPECT_EQ(got.reports.at(input), text) << "stopped at " << stop;
      }
    }
    // Nothing half-written is left over, neither beside the outputs nor beside the results.
    EXPECT_FALSE(memory.files.info("/plan/results/00000.parts")) << stop;
    for (const std::string folder : {"/repaired", "/plan/results"}) {
      const auto names = memory.files.list(folder).value();
      for (const std::string& name : names) {
        EXPECT_FALSE(name.ends_with(".tmp")) << folder << "/" << name << " at " << stop;
      }
    }
    ++cuts;
    if (survived) {
      break;
    }
  }
  EXPECT_GT(cuts, 40U);
}

// Shards of two plans may work in one folder, and both plans may hold a file.
TEST_F(Archive, WhatAnotherRunIsWritingStays) {
  MemoryEnv memory;
  Random random(3);
  MadeRecording made = few_seconds(random);
  made.serial = "MOS2A45130450";
  made.firmware = "1.5.0";
  ASSERT_OK(memory.files.make_folders("/archive"));
  ASSERT_OK(made.write(memory.files, "/archive/a.gt3x"));
  const auto planned = plan(memory, draft(1));
  ASSERT_OK(planned);
  ASSERT_OK(memory.files.make_folders("/repaired"));
  const std::string theirs = "/repaired/.a.gt3x.0.tmp";
  const auto lock = memory.files.lock(theirs);
  ASSERT_OK(lock);
  ASSERT_OK(run_shard(memory.env, "/plan", planned->plan, shard(0)));
  EXPECT_TRUE(memory.files.info("/repaired/a.gt3x"));
  EXPECT_TRUE(memory.files.info(theirs));
}

TEST_F(Archive, WhatAStoppedRunDidIsNotDoneAgain) {
  MemoryEnv memory;
  fill(memory.files, 4, 12);
  const auto planned = plan(memory, draft(1));
  ASSERT_OK(planned);
  // Stopped while the ninth file is looked at: eight are written down, two by two.
  struct Stop {};
  ShardRunOptions options = shard(0);
  options.progress = [](const RepairProgress& done, std::size_t) {
    if (done.files == 9) {
      throw Stop{};
    }
  };
  EXPECT_THROW(static_cast<void>(run_shard(memory.env, "/plan", planned->plan, options)), Stop);
  auto standing = standing_of(memory.files, "/plan", planned->plan, 0);
  EXPECT_EQ(standing.state, ShardState::partly);
  EXPECT_EQ(standing.done.files, 8U);
  RepairProgress expected;
  const auto manifest = read_manifest(memory.files, "/plan", planned->plan, 0).value();
  for (std::size_t i = 0; i < 8; ++i) {
    expected.bytes += manifest[i].size;
  }
  EXPECT_EQ(standing.done.bytes, expected.bytes);
  EXPECT_FAILS(read_result(memory.files, "/plan", planned->plan, 0), ErrorCode::no_input);
  const auto again = run_shard(memory.env, "/plan", planned->plan, shard(0));
  ASSERT_OK(again);
  std::size_t failed = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    failed += again->files[i].status == RepairStatus::failed ? 1 : 0;
  }
  EXPECT_EQ(again->done_before, 8 - failed) << "what failed is tried again";
  EXPECT_EQ(standing.done.failed, failed) << "status says so before the end";
  standing = standing_of(memory.files, "/plan", planned->plan, 0);
  EXPECT_EQ(standing.state, ShardState::done);
}

TEST_F(Archive, TwoRunsOfOneShardAtATimeAreRefused) {
  MemoryEnv memory;
  fill(memory.files, 6, 4);
  const auto planned = plan(memory, draft(2));
  ASSERT_OK(planned);
  std::size_t refused = 0;
  ShardRunOptions options = shard(0);
  options.progress = [&](const RepairProgress& done, std::size_t) {
    if (done.files == 0) {
      const auto other = run_shard(memory.env, "/plan", planned->plan, shard(0));
      EXPECT_FAILS(other, ErrorCode::cannot_create);
      EXPECT_EQ(standing_of(memory.files, "/plan", planned->plan, 0).state, ShardState::running);
      EXPECT_OK(run_shard(memory.env, "/plan", planned->plan, shard(1))) << "another shard may";
      ++refused;
    }
  };
  EXPECT_OK(run_shard(memory.env, "/plan", planned->plan, options));
  EXPECT_EQ(refused, 1U);
}

TEST_F(Archive, WhereRepairIsAtWorkNoShardBegins) {
  MemoryEnv memory;
  fill(memory.files, 6, 4);
  const auto planned = plan(memory, draft(1));
  ASSERT_OK(planned);
  auto at_work = lock_for_repair(memory.files, "/repaired").value();
  EXPECT_FAILS(run_shard(memory.env, "/plan", planned->plan, shard(0)), ErrorCode::cannot_create);
  at_work.reset();
  ShardRunOptions options = shard(0);
  std::size_t refused = 0;
  options.progress = [&](const RepairProgress&, std::size_t) {
    refused += lock_for_repair(memory.files, "/repaired") ? 0 : 1;
  };
  EXPECT_OK(run_shard(memory.env, "/plan", planned->plan, options));
  EXPECT_EQ(refused, 5U) << "before each file and at the end";
  EXPECT_NE(lock_for_repair(memory.files, "/repaired").value(), nullptr);
}

TEST_F(Archive, AFileThatChangedSinceThePlanIsReportedAndNotRepaired) {
  for (const bool hash : {false, true}) {
    MemoryEnv memory;
    Random random(1);
    ASSERT_OK(memory.files.make_folders("/archive"));
    MadeRecording made = few_seconds(random);
    made.firmware = "1.5.0";
    made.serial = "MOS2A45130450";
    for (const char* name : {"changed", "gone", "same", "touched"}) {
      ASSERT_OK(made.write(memory.files, std::string("/archive/") + name + ".gt3x"));
    }
    ArchiveDraft how = draft(1);
    how.hash = hash;
    const auto planned = plan(memory, how);
    ASSERT_OK(planned);
    made.raw[3][1] += 1;  // the size is the same
    ASSERT_OK(memory.files.remove("/archive/changed.gt3x"));
    ASSERT_OK(made.write(memory.files, "/archive/changed.gt3x"));
    made.raw[3][1] -= 1;
    ASSERT_OK(memory.files.remove("/archive/touched.gt3x"));
    ASSERT_OK(made.write(memory.files, "/archive/touched.gt3x"));  // the same bytes, another time
    ASSERT_OK(memory.files.remove("/archive/gone.gt3x"));
    const auto result = run_shard(memory.env, "/plan", planned->plan, shard(0));
    ASSERT_OK(result);
    EXPECT_EQ(result->files[0].status, RepairStatus::failed);
    EXPECT_EQ(result->files[0].error->code, ErrorCode::bad_data);
    EXPECT_THAT(result->files[0].reasons.front(), HasSubstr("changed"));
    EXPECT_FALSE(memory.files.info("/repaired/changed.gt3x"));
    EXPECT_EQ(result->files[1].status, RepairStatus::failed);
    EXPECT_EQ(result->files[1].error->code, ErrorCode::no_input);
    EXPECT_EQ(result->files[2].status, RepairStatus::repaired);
    EXPECT_EQ(result->files[3].status, hash ? RepairStatus::repaired : RepairStatus::failed)
        << "where there is a hash, the hash decides";
  }
}

// A copy that keeps the time, or a disk that lost bytes: size and time are as they were. A file that
// needs no repair is not hashed on its way.
TEST_F(Archive, WhereThePlanHasHashesTheyDecideForEveryFile) {
  namespace fs = std::filesystem;
  const sixpoint::tests::TemporaryFolder folder;
  Env& env = posix_env();
  fs::create_directories(folder / "archive");
  Random random(1);
  MadeRecording made = few_seconds(random);
  made.serial = "MOS2A45130450";
  made.firmware = "1.5.0";
  MadeRecording sound = made;
  sound.firmware = "1.8.0";
  const auto write = [&] {
    EXPECT_OK(made.write(env.files, folder / "archive/affected.gt3x"));
    EXPECT_OK(sound.write(env.files, folder / "archive/sound.gt3x"));
  };
  write();
  ArchiveDraft how = draft(1);
  how.paths = {folder / "archive"};
  how.hash = true;
  auto planned = plan_archive(env, how);
  ASSERT_OK(planned);
  ASSERT_OK(write_plan(env, folder / "plan", how, *planned));
  made.raw[3][1] += 1;
  sound.raw[3][1] += 1;
  write();
  for (const ArchiveFile& file : planned->files) {
    const std::string path = planned->plan.input_of(file);
    ASSERT_EQ(fs::file_size(path), file.size);
    std::array<timespec, 2> times{};
    times[0].tv_nsec = UTIME_OMIT;
    times[1].tv_sec = file.modified_ns / 1'000'000'000;
    times[1].tv_nsec = file.modified_ns % 1'000'000'000;
    ASSERT_EQ(::utimensat(AT_FDCWD, path.c_str(), times.data(), 0), 0);
    ASSERT_EQ(env.files.info(path).value().modified_ns, file.modified_ns);
  }
  ShardRunOptions options = shard(0);
  options.output_folder = folder / "out";
  const auto result = run_shard(env, folder / "plan", planned->plan, options);
  ASSERT_OK(result);
  ASSERT_EQ(result->files.size(), 2U);
  for (const RepairReport& report : result->files) {
    EXPECT_TRUE(has_changed_since_plan(report)) << report.brief();
  }
  EXPECT_FALSE(fs::exists(folder / "out/affected.gt3x"));
}

TEST_F(Archive, TheFolderOfAFileThatWasNamedIsNoOutputFolder) {
  MemoryEnv memory;
  Random random(3);
  ASSERT_OK(memory.files.make_folders("/archive"));
  ASSERT_OK(few_seconds(random).write(memory.files, "/archive/a.gt3x"));
  ArchiveDraft how = draft(1);
  how.paths = {"/archive/a.gt3x"};
  const auto planned = plan(memory, how);
  ASSERT_OK(planned);
  ShardRunOptions options = shard(0);
  options.output_folder = "/archive";
  EXPECT_FAILS(run_shard(memory.env, "/plan", planned->plan, options), ErrorCode::usage);
  options.output_folder = "/archive/repaired";
  EXPECT_OK(run_shard(memory.env, "/plan", planned->plan, options)) << "another folder may";
}

TEST_F(HostilePlan, OutputFoldersThatCannotBe) {
  for (const char* folder : {"/archive", "/archive/repaired", "/"}) {
    ShardRunOptions options = shard(0);
    options.output_folder = folder;
    SCOPED_TRACE(folder);
    EXPECT_FAILS(run_shard(memory_.env, "/plan", plan_, options), ErrorCode::usage);
  }
  EXPECT_OK(run_first());
  ShardRunOptions elsewhere = shard(1);
  elsewhere.output_folder = "/elsewhere";
  const auto other = run_shard(memory_.env, "/plan", plan_, elsewhere);
  EXPECT_FAILS(other, ErrorCode::usage);
  EXPECT_THAT(other.error().brief(), HasSubstr("/repaired"));
}

}  // namespace
}  // namespace sixpoint::repair
