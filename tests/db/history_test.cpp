#include "db/history.h"

#include "store_fixture.h"

namespace sixpoint::db {
namespace {

TEST_F(StoreTest, TheHistoryHasTheRowsOfAllTablesInOrder) {
  Store store = open();
  ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 1), "w"));
  ASSERT_OK(store.add_constants(constants("MOS2A2", "current", 2), "w"));
  std::vector<std::string> names;
  const auto transaction = Transaction::reading(store.database());
  ASSERT_OK(for_each_history_row(store.database(), [&](const HistoryRow& row) {
    EXPECT_EQ(row.seq, static_cast<std::int64_t>(names.size()) + 1);
    EXPECT_EQ(row.hash.size(), 32U);
    names.emplace_back(row.table->name);
    return Status();
  }));
  EXPECT_EQ(names, (std::vector<std::string>{"units", "filter_configurations", "constants", "units",
                                             "constants"}));
  EXPECT_EQ(read_head(store.database())->rows, 5);
  EXPECT_FAILS(for_each_history_row(store.database(),
                                    [](const HistoryRow&) -> Status {
                                      return fail(ErrorCode::io, "stop", {}, "none");
                                    }),
               ErrorCode::io);
}

TEST_F(StoreTest, ACopiedRowMustFollowTheChain) {
  Store store = open();
  auto transaction = Transaction::writing(store.database());
  auto writer = HistoryWriter::open(store.database()).value();
  const Row unit = {std::string("MOS2A1"), std::string("w"), std::int64_t{0}};
  const Sha256Digest hash = ChainHasher().hash(Bytes(32, 0), table("units"), 1, unit);
  EXPECT_FAILS(writer.append_copy({&table("units"), 2, unit, hash}), ErrorCode::bad_data);
  Sha256Digest other = hash;
  other[0] ^= 1;
  EXPECT_FAILS(writer.append_copy({&table("units"), 1, unit, other}), ErrorCode::bad_data);
  EXPECT_OK(writer.append_copy({&table("units"), 1, unit, hash}));
  EXPECT_EQ(writer.head().hash, Bytes(hash.begin(), hash.end()));
}

TEST_F(StoreTest, WithoutItsHeadAStoreTakesNoRow) {
  Store store = open();
  ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 1), "w"));
  for (const std::string& change :
       {"UPDATE head SET hash = " + place_->empty_bytes(), std::string("DELETE FROM head")}) {
    SCOPED_TRACE(change);
    place_->tamper("main", change);
    const auto added = store.add_constants(constants("MOS2A1", "current", 2), "w");
    EXPECT_FAILS(added, ErrorCode::bad_data);
    EXPECT_EQ(added.error().where, store.database().location());
    EXPECT_THAT(added.error().hint, testing::HasSubstr("backup"));
    EXPECT_FAILS(store.head(), ErrorCode::bad_data);
    EXPECT_EQ(store.history("MOS2A1")->size(), 1U);
    EXPECT_THAT(store.audit()->findings,
                testing::ElementsAre(testing::HasSubstr("the head does not name the last row")));
  }
}

}  // namespace
}  // namespace sixpoint::db
