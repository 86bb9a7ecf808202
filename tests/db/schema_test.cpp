#include "db/schema.h"

#include "store_fixture.h"

namespace sixpoint::db {
namespace {

TEST(Schema, ListsColumnsInTheirOrder) {
  EXPECT_EQ(column_list(table("units")), "seq, serial, model, first_seen_ns, hash");
  EXPECT_EQ(record_columns(table("captures")),
            "captures.id, captures.run_id, captures.name, captures.sha256");
  EXPECT_EQ(find_table("none"), nullptr);
  EXPECT_EQ(tables().size(), 9U);
}

TEST_F(StoreTest, MigratesOnce) {
  Store store = open();
  EXPECT_EQ(store.database().schema_version().value(), 3);
  ASSERT_OK(migrate(store.database()));
  EXPECT_EQ(store.database().schema_version().value(), 3);
  EXPECT_EQ(store.audit()->rows, 0);
}

}  // namespace
}  // namespace sixpoint::db
