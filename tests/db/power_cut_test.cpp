// A power cut at every sync point of an SQLite store: what was acknowledged is there, the chain
// verifies, nothing is half written.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "db/save.h"
#include "expect_result.h"
#include "power_cut_disk.h"
#include "sanitized.h"
#include "temporary_folder.h"

namespace sixpoint::db {
namespace {

using tests::PowerCutDisk;

// Under the sanitizers the power is cut at every fourth sync point.
constexpr std::size_t kCutEvery = sixpoint::tests::kSanitized ? 4 : 1;

void write(const PowerCutDisk::Image& image, const sixpoint::tests::TemporaryFolder& folder) {
  for (const auto& [name, bytes] : image) {
    std::ofstream(folder / name, std::ios::binary) << as_text(bytes);
  }
}

class PowerCutTest : public testing::Test {
 protected:
  // Opens the image with SQLite's own file system and looks for every acknowledged row.
  void check(const PowerCutDisk::Image& image) {
    const sixpoint::tests::TemporaryFolder folder;
    write(image, folder);
    auto store = Store::open(memory_.env, folder / "store.db");
    ASSERT_OK(store);
    const auto history = store->unit_history("MOS2A1");
    ASSERT_OK(history);
    const std::size_t stored = history->constants.size() + history->runs.size();
    ASSERT_GE(stored, acknowledged_.size());
    ASSERT_LE(stored, acknowledged_.size() + 1) << "at most the one that was being written";
    for (const auto& record : history->constants) {
      there_.insert(record.id);
    }
    for (const auto& record : history->runs) {
      there_.insert(record.id);
    }
    for (const std::string& id : acknowledged_) {
      ASSERT_TRUE(there_.contains(id)) << id;
    }
    there_.clear();
    const auto audit = store->audit();
    ASSERT_OK(audit);
    ASSERT_TRUE(audit->ok) << audit->brief();
    const auto whole = store->database().query("PRAGMA integrity_check");
    ASSERT_OK(whole);
    ASSERT_EQ(text_of((*whole)[0][0]), "ok");
    // And it goes on.
    ConstantsRecord more;
    more.serial = "MOS2A1";
    more.filter = "legacy";
    more.document = "{}";
    ASSERT_OK(store->add_constants(more, "w"));
  }

  void add(Store& store, int number) {
    Result<std::string> id = fail(ErrorCode::internal, "", "", "");
    if (number % 3 == 0) {
      // With a capture that is larger than SQLite's pages, and different every time.
      RunRecord run;
      run.serial = "MOS2A1";
      run.filter = "current";
      run.started = from_unix_seconds(number);
      run.document = "{}";
      Bytes capture(200'000);
      for (std::size_t i = 0; i < capture.size(); ++i) {
        capture[i] = static_cast<std::uint8_t>((i * 7 + static_cast<std::size_t>(number)) >> 3);
      }
      id = store.add_run(run, {{"raw", capture}});
    } else {
      ConstantsRecord record;
      record.serial = "MOS2A1";
      record.filter = "current";
      record.made_at = from_unix_seconds(number);
      record.document = R"({"made_from":{"n":1}})";
      id = store.add_constants(record, "w");
    }
    ASSERT_OK(id);
    acknowledged_.push_back(*id);
  }

  MemoryEnv memory_;
  std::vector<std::string> acknowledged_;
  std::set<std::string> there_;
};

TEST_F(PowerCutTest, AtEverySyncPointEveryAcknowledgedRowIsThere) {
  const sixpoint::tests::TemporaryFolder folder;
  PowerCutDisk disk;
  Random random(11);
  std::size_t images = 0;
  std::size_t synced = 0;
  disk.at_sync = [&] {
    if (synced++ % kCutEvery != 0) {
      return;
    }
    for (const auto unsynced : {PowerCutDisk::Unsynced::dropped, PowerCutDisk::Unsynced::kept,
                                PowerCutDisk::Unsynced::scattered}) {
      if (HasFatalFailure()) {
        return;
      }
      SCOPED_TRACE(testing::Message() << "sync point " << disk.sync_points() << ", form "
                                      << static_cast<int>(unsynced));
      check(disk.image(unsynced, random));
      ++images;
    }
  };
  int number = 0;
  // Opened and closed several times, with enough rows in between for a checkpoint in mid-work.
  for (const int rows : {2, 5, 90}) {
    auto store = Store::open(memory_.env, folder / "store.db");
    ASSERT_OK(store);
    for (int i = 0; i < rows; ++i) {
      add(*store, ++number);
      ASSERT_FALSE(HasFatalFailure());
    }
  }
  EXPECT_GT(disk.sync_points(), 200U) << "at least one before and one after each commit";
  EXPECT_EQ(synced, disk.sync_points());
  EXPECT_EQ(images, 3 * ((synced + kCutEvery - 1) / kCutEvery));
  RecordProperty("sync_points", static_cast<int>(disk.sync_points()));
  std::cout << disk.sync_points() << " sync points, " << images << " images of the disk\n";
}

// The oracle of the test above: it must find out a store that does not sync.
TEST_F(PowerCutTest, AStoreThatDoesNotSyncWouldBeFoundOut) {
  const sixpoint::tests::TemporaryFolder folder;
  PowerCutDisk disk;
  auto store = Store::open(memory_.env, folder / "store.db");
  ASSERT_OK(store);
  add(*store, 1);
  ASSERT_OK(store->database().execute("PRAGMA synchronous=OFF"));
  add(*store, 2);
  Random random(1);
  const auto image = disk.image(PowerCutDisk::Unsynced::dropped, random);
  ASSERT_TRUE(image.contains("store.db"));
  const sixpoint::tests::TemporaryFolder after;
  write(image, after);
  auto lost = Store::open(memory_.env, after / "store.db");
  ASSERT_OK(lost);
  EXPECT_EQ(
      lost->unit_history("MOS2A1")->constants.size() + lost->unit_history("MOS2A1")->runs.size(),
      1U)
      << "the second row was acknowledged, and is gone";
}

}  // namespace
}  // namespace sixpoint::db
