// Backup: a copy of the store that is a store.
#include "base/atomic_file.h"
#include "db/exchange_fixture.h"
#include "failing_files.h"

namespace sixpoint::db {
namespace {

TEST_F(ExchangeTest, ABackupIsAStoreWithTheSameHead) {
  Store store = open("first");
  fill(store);
  const std::string path = folder_ / "backup.db";
  for (int round = 0; round < 2; ++round) {
    Env env{memory_.clock, posix_env().files};
    const auto report = backup(store, env, path);
    ASSERT_OK(report);
    EXPECT_EQ(report->attachments, 2);
    auto copy = Store::open(memory_.env, path);
    ASSERT_OK(copy);
    const auto audit = copy->audit();
    EXPECT_TRUE(audit->ok) << audit->brief();
    EXPECT_EQ(audit->head, store.audit()->head);
    EXPECT_EQ(report->head, audit->head);
    fill(store, 6);
  }
  const auto names = posix_env().files.list(folder_.path());
  EXPECT_THAT(*names, testing::ElementsAre("backup.db")) << "nothing else is left beside it";
  Env env{memory_.clock, posix_env().files};
  EXPECT_FAILS(backup(store, env, folder_ / "none/backup.db"), ErrorCode::cannot_create);
}

TEST_F(ExchangeTest, ADamagedStoreIsNotBackedUpAndTheEarlierBackupStays) {
  Store store = open("first");
  fill(store);
  Env env{memory_.clock, posix_env().files};
  const std::string path = folder_ / "backup.db";
  ASSERT_OK(backup(store, env, path));
  const Bytes before = read_file(env.files, path).value();
  place_->tamper("first", "UPDATE attachments SET bytes = " + place_->empty_bytes());
  const auto refused = backup(store, env, path);
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_THAT(refused.error().what, testing::HasSubstr(to_hex(sha256(Bytes{0, 1, 255}))));
  EXPECT_EQ(refused.error().where, store.database().location());
  EXPECT_EQ(read_file(env.files, path).value(), before);
  EXPECT_THAT(env.files.list(folder_.path()).value(), testing::ElementsAre("backup.db"));
}

TEST_F(ExchangeTest, ABackupTakesNotThePlaceOfAStoreThatIsAtWork) {
  Env env{memory_.clock, posix_env().files};
  Store other = open("first");
  const std::string path = folder_ / "at_work.db";
  auto at_work = Store::open(env, path);
  ASSERT_OK(at_work);
  fill(*at_work);
  for (Store* from : {&*at_work, &other}) {
    const auto refused = backup(*from, env, path);
    EXPECT_FAILS(refused, ErrorCode::cannot_create);
    EXPECT_EQ(refused.error().where, path);
  }
  EXPECT_TRUE(at_work->audit()->ok);
  EXPECT_EQ(at_work->history("MOS2A1")->size(), 3U);
}

// As two backups to one name do at a time; and one that was killed.
TEST_F(ExchangeTest, ABackupLeavesTheTemporaryFilesOfAnotherOneThatIsAtWork) {
  Store store = open("first");
  fill(store);
  Env env{memory_.clock, posix_env().files};
  const std::string path = folder_ / "backup.db";
  const std::string of_other = folder_ / ".backup.db.0.tmp";
  auto lock = env.files.lock(of_other);
  ASSERT_OK(lock);
  ASSERT_OK(write_file(env.files, of_other + ".db", "half a copy"));
  ASSERT_OK(backup(store, env, path));
  EXPECT_EQ(as_text(read_file(env.files, of_other + ".db").value()), "half a copy");
  EXPECT_TRUE(env.files.info(of_other));
  lock->reset();
  ASSERT_OK(backup(store, env, path));
  EXPECT_THAT(env.files.list(folder_.path()).value(), testing::ElementsAre("backup.db"))
      << "what a process that is gone left is removed";
}

TEST_F(ExchangeTest, WhateverTheDiskRefusesABackupIsTheEarlierOrTheNewOne) {
  Store small = open("small");
  fill(small, 1);
  Store large = open("large");
  fill(large, 3);
  sixpoint::tests::FailingFiles files(posix_env().files);
  Env env{memory_.clock, files};
  const std::string path = folder_ / "backup.db";
  std::size_t failures = 0;
  for (;; ++failures) {
    ASSERT_OK(backup(small, env, path));
    files.fail_at(failures);
    const auto report = backup(large, env, path);
    files.stop_failing();
    if (report && files.has_failed()) {  // the last call, which removes the file that was locked
      EXPECT_THAT(env.files.list(folder_.path()).value(),
                  testing::UnorderedElementsAre("backup.db", ".backup.db.0.tmp"));
      ASSERT_OK(backup(large, env, path)) << "and takes it away";
    }
    EXPECT_THAT(env.files.list(folder_.path()).value(), testing::ElementsAre("backup.db"));
    if (report && !files.has_failed()) {
      break;
    }
    if (!report) {
      EXPECT_FAILS(report, ErrorCode::io);
    }
    auto copy = Store::open_to_read(env, path);
    ASSERT_OK(copy);
    EXPECT_THAT(copy->audit()->head, testing::AnyOf(small.audit()->head, large.audit()->head));
  }
  EXPECT_GT(failures, 1U);
}

TEST_F(ExchangeTest, AnImportIntoANewFileLeavesAFileThatIsThereAsItIs) {
  Env env{memory_.clock, posix_env().files};
  Store store = open("first");
  fill(store);
  ASSERT_OK(export_json_lines(store, env.files, folder_ / "all.jsonl"));
  ASSERT_OK(write_file(env.files, folder_ / "there.db", "other bytes"));
  const auto refused = import_into_new_file(env, folder_ / "all.jsonl", folder_ / "there.db");
  EXPECT_FAILS(refused, ErrorCode::cannot_create);
  EXPECT_EQ(refused.error().where, folder_ / "there.db");
  EXPECT_EQ(as_text(read_file(env.files, folder_ / "there.db").value()), "other bytes");
  EXPECT_FAILS(import_into_new_file(env, folder_ / "none.jsonl", folder_ / "new.db"),
               ErrorCode::no_input);
  EXPECT_THAT(env.files.list(folder_.path()).value(),
              testing::ElementsAre("all.jsonl", "there.db"));
}

}  // namespace
}  // namespace sixpoint::db
