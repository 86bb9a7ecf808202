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

}  // namespace
}  // namespace sixpoint::db
