// Backup: a copy of the store that is a store.
#include "db/exchange_fixture.h"

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

}  // namespace
}  // namespace sixpoint::db
