#include "db/servers/database.h"

#include "db/store_fixture.h"

namespace sixpoint::db {
namespace {

TEST(Values, AnswerTheirOwnTypeOnly) {
  EXPECT_EQ(text_of(Value(std::string("a"))), "a");
  EXPECT_EQ(text_of(Value(std::int64_t{1})), "");
  EXPECT_EQ(integer_of(Value(std::int64_t{1})), 1);
  EXPECT_EQ(integer_of(Value()), 0);
  EXPECT_EQ(to_ns(from_unix_seconds(2)), 2'000'000'000);
  EXPECT_EQ(from_ns(2'000'000'000), from_unix_seconds(2));
}

TEST_F(StoreTest, ATransactionWithoutCommitLeavesNothing) {
  Store store = open();
  Database& database = store.database();
  const std::string insert = "INSERT INTO attachments (sha256, bytes) VALUES ($1, $2)";
  const auto count = [&] {
    return integer_of(database.query("SELECT count(*) FROM attachments").value()[0][0]);
  };
  {
    auto transaction = Transaction::writing(database);
    ASSERT_OK(transaction);
    ASSERT_OK(database.execute(insert, Row{std::string("a"), Bytes{1}}));
  }
  EXPECT_EQ(count(), 0);
  {
    auto transaction = Transaction::writing(database);
    ASSERT_OK(transaction);
    ASSERT_OK(database.execute(insert, Row{std::string("a"), Bytes{1}}));
    ASSERT_OK(transaction->commit());
  }
  EXPECT_EQ(count(), 1);
}

TEST_F(StoreTest, AStatementThatTheServerDoesNotKnowIsAnErrorThatNamesTheStore) {
  Store store = open();
  Database& database = store.database();
  const auto refused = [&](const auto& result) {
    EXPECT_FAILS(result, ErrorCode::internal);
    EXPECT_THAT(result.error().what, testing::HasSubstr("nonsense"));
    EXPECT_EQ(result.error().where, database.location());
  };
  refused(database.query("SELECT nonsense FROM units"));
  refused(database.execute("INSERT INTO nonsense VALUES (1)"));
  const auto transaction = Transaction::reading(database);
  ASSERT_OK(transaction);
  refused(database.stream("SELECT nonsense FROM units", {}));
}

}  // namespace
}  // namespace sixpoint::db
