#include "station/page/repair_job.h"

#include <stdexcept>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <pthread.h>

#include "base/atomic_file.h"
#include "base/forwarding_files.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/archive/output_lock.h"
#include "repair/made_recording.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/repair_records.h"
#include "station/records/software.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

constexpr const char* kConstants =
    R"({"serial":"MOS2A45130450","filter":"current","constants":)"
    R"({"sensitivity_g_per_lsb":[0.004,0.004,0.004],"zero_lsb":[60,5,90]},)"
    R"("method":"jig","made_at":"2014-05-01T00:00:00Z","gravity_m_per_s2":9.81})";

// One machine: an archive with an affected recording, and a store with its unit's constants.
class Machine {
 public:
  Machine() {
    tests::MadeRecording made;
    for (int i = 0; i < 3000; ++i) {
      made.raw.push_back({61 + i % 2, 4, 340});
    }
    EXPECT_OK(memory.files.make_folders("archive"));
    EXPECT_OK(made.write(memory.files, "archive/a.gt3x"));
    auto store = open();
    db::ConstantsRecord record;
    record.serial = made.serial;
    record.filter = "current";
    record.method = "jig";
    record.document = kConstants;
    EXPECT_OK(store->add_constants(record, "wGT3XBT"));
  }

  Result<db::Store> open() { return db::Store::open(memory.env, folder / "store.db"); }

  nlohmann::ordered_json repair_by_the_page() {
    RepairJob job(memory.env, [this] { return open(); });
    EXPECT_OK(job.start({"archive", "out", ""}));
    while (job.to_json()["state"] == "running") {
      std::this_thread::yield();
    }
    return job.to_json();
  }

  // As `sixpoint repair archive -o out --store store.db` does it.
  void repair_by_the_command() {
    auto store = open();
    repair::ConstantsFinderOptions options;
    options.store = &*store;
    repair::ConstantsFinder finder(memory.env, options);
    ASSERT_OK(memory.files.make_folders("out"));
    const auto report = repair::repair_file(memory.env, "archive/a.gt3x", "out/a.gt3x", finder, {});
    for (const auto& record : repair::records_of(*store, {report}, software_and_build()).records) {
      ASSERT_OK(store->add_repair(record));
    }
  }

  MemoryEnv memory;
  sixpoint::tests::TemporaryFolder folder;
};

// A defect that throws ends the job alone, and the next one begins.
TEST(RepairJobTest, ADefectEndsTheJobAndNotTheProgram) {
  Machine page;
  bool is_defect = true;
  RepairJob job(page.memory.env, [&]() -> Result<db::Store> {
    if (is_defect) {
      throw std::runtime_error("made by the test");
    }
    return page.open();
  });
  const auto state_at_the_end = [&] {
    EXPECT_OK(job.start({"archive", "out", ""}));
    while (job.to_json()["state"] == "running") {
      std::this_thread::yield();
    }
    return job.to_json()["state"];
  };
  EXPECT_EQ(state_at_the_end(), "failed");
  EXPECT_EQ(job.to_json()["error"], "a defect of the program ended the repair: made by the test");
  is_defect = false;
  EXPECT_EQ(state_at_the_end(), "done");
}

// No machine has the memory for the stack of this thread.
TEST(RepairJobTest, AJobThatGetsNoThreadHasFailed) {
  Machine machine;
  RepairJob job(machine.memory.env, [&] { return machine.open(); });
  pthread_attr_t usual{};
  pthread_attr_t huge{};
  ASSERT_EQ(::pthread_getattr_default_np(&usual), 0);
  ASSERT_EQ(::pthread_getattr_default_np(&huge), 0);
  ASSERT_EQ(::pthread_attr_setstacksize(&huge, std::size_t{1} << 50U), 0);
  ASSERT_EQ(::pthread_setattr_default_np(&huge), 0);
  const auto refused = job.start({"archive", "out", ""});
  ASSERT_EQ(::pthread_setattr_default_np(&usual), 0);
  EXPECT_FAILS(refused, ErrorCode::io);
  EXPECT_EQ(job.to_json()["state"], "failed");
  EXPECT_THAT(job.to_json()["error"].get<std::string>(), testing::HasSubstr("no more threads"));
  ASSERT_OK(job.start({"archive", "out", ""}));
  while (job.to_json()["state"] == "running") {
    std::this_thread::yield();
  }
  EXPECT_EQ(job.to_json()["state"], "done");
}

TEST(RepairJobTest, TheStoreGetsTheRowsOfTheCommand) {
  Machine page;
  Machine command;
  const UtcTime now = page.memory.clock.now();
  const auto answer = page.repair_by_the_page();
  EXPECT_EQ(answer["state"], "done") << answer;
  EXPECT_EQ(answer["summary"]["repaired"], 1) << answer;
  command.repair_by_the_command();
  auto store = page.open();
  EXPECT_EQ(store->audit()->head, command.open()->audit()->head) << "the same rows, to the bit";

  const auto repairs = store->unit_history("MOS2A45130450")->repairs;
  ASSERT_EQ(repairs.size(), 1U);
  EXPECT_EQ(repairs[0].made_at, now);
  EXPECT_EQ(repairs[0].method, "store");
  EXPECT_EQ(repairs[0].constants_id, store->history("MOS2A45130450")->front().id);
  EXPECT_EQ(repairs[0].software, software_and_build());
}

TEST(RepairJobTest, ARepeatedJobAddsNoRow) {
  Machine machine;
  machine.repair_by_the_page();
  const std::string head = machine.open()->audit()->head;
  machine.memory.clock.set(machine.memory.clock.now() + std::chrono::hours(24));
  EXPECT_EQ(machine.repair_by_the_page()["summary"]["repaired"], 1) << "taken as done";
  EXPECT_EQ(machine.open()->audit()->head, head);
}

TEST(RepairJobTest, RefusesASecondJobAndAnEmptyFolder) {
  Machine machine;
  RepairJob job(machine.memory.env, [&] { return machine.open(); });
  EXPECT_FAILS(job.start({"none", "out", ""}), ErrorCode::no_input);
  EXPECT_EQ(job.to_json()["state"], "none");
}

TEST(RepairJobTest, HoldsTheLockOfTheCommandAndLeavesItsManifest) {
  Machine machine;
  // Whether the folder is locked whenever the recording or the manifest is opened.
  class Looking final : public ForwardingFiles {
   public:
    explicit Looking(FileSystem& files) : ForwardingFiles(files), files_(files) {}
    Result<std::unique_ptr<ReadableFile>> open(const std::string& path) override {
      look(path);
      return ForwardingFiles::open(path);
    }
    Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
      look(path);
      return ForwardingFiles::create(path);
    }
    int locked = 0;
    int free = 0;

   private:
    void look(const std::string& path) {
      if (path == "archive/a.gt3x" || path.starts_with("out/units.csv")) {
        ++(repair::lock_for_repair(files_, "out") ? free : locked);
      }
    }
    FileSystem& files_;
  } looking(machine.memory.files);
  Env env{machine.memory.clock, looking};
  RepairJob job(env, [&] { return machine.open(); });
  {
    const auto command = repair::lock_for_repair(machine.memory.files, "out");
    ASSERT_OK(command);
    const auto refused = job.start({"archive", "out", ""});
    EXPECT_FAILS(refused, ErrorCode::cannot_create);
    EXPECT_THAT(refused.error().what, testing::HasSubstr("another run is repairing"));
    EXPECT_THAT(refused.error().hint, testing::HasSubstr("wait for it"));
    EXPECT_EQ(job.to_json()["state"], "none");
  }
  ASSERT_OK(job.start({"archive", "out", ""}));
  while (job.to_json()["state"] == "running") {
    std::this_thread::yield();
  }
  EXPECT_GE(looking.locked, 2) << "while the job is at work";
  EXPECT_EQ(looking.free, 0);
  EXPECT_OK(repair::lock_for_repair(machine.memory.files, "out")) << "and not behind it";
  const Bytes csv = read_file(machine.memory.files, "out/manifest.csv").value();
  EXPECT_THAT(std::string(csv.begin(), csv.end()),
              testing::HasSubstr("archive/a.gt3x,out/a.gt3x,repaired,store,"));
  EXPECT_OK(machine.memory.files.info("out/manifest.json"));
  EXPECT_OK(machine.memory.files.info("out/units.csv"));
}

TEST(RepairJobTest, RefusesAtOnceWhatCannotWork) {
  const sixpoint::tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  ASSERT_OK(files.make_folders(folder / "in"));
  tests::MadeRecording made;
  made.raw.assign(300, {61, 4, 340});
  ASSERT_OK(made.write(files, folder / "in/a.gt3x"));
  ASSERT_OK(write_file(files, folder / "file", "x"));
  RepairJob job(posix_env(), [&] { return db::Store::open(posix_env(), folder / "store.db"); });
  EXPECT_FAILS(job.start({folder / "in", folder / "out", folder / "none.gt3x"}),
               ErrorCode::no_input);
  EXPECT_FAILS(job.start({folder / "in", folder / "out", folder / "file"}), ErrorCode::bad_data);
  EXPECT_FAILS(job.start({folder / "in", folder / "file", ""}), ErrorCode::cannot_create);
  EXPECT_EQ(job.to_json()["state"], "none");
}

}  // namespace
}  // namespace sixpoint::station
