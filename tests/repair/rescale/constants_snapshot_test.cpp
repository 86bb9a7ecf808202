#include "repair/rescale/constants_snapshot.h"

#include "repair/archive/archive_fixture.h"

namespace sixpoint::repair {
namespace {

TEST_F(Archive, TheSnapshotGivesWhatTheStoreGives) {
  MemoryEnv memory;
  auto store = db::Store::in_memory(memory.env);
  ASSERT_OK(store);
  db::ConstantsRecord record = tests::jig_constants();
  const auto first = store->add_constants(record, "");
  ASSERT_OK(first);
  record.made_at = from_unix_seconds(1'700'000'001);
  const auto second = store->add_constants(record, "");
  ASSERT_OK(second);
  record.filter = "legacy";
  record.serial = "MOS2A45130451";
  ASSERT_OK(store->add_constants(record, ""));
  ASSERT_OK(store->withdraw_constants(*second, "A. Tester", "wrong jig"));
  const auto taken = ConstantsSnapshot::of_store(*store);
  ASSERT_OK(taken);
  const auto snapshot = ConstantsSnapshot::parse(taken->to_json_lines());
  ASSERT_OK(snapshot);
  EXPECT_EQ(snapshot->size(), 1U);
  ASSERT_NE(snapshot->find("MOS2A45130450"), nullptr);
  EXPECT_EQ(snapshot->find("MOS2A45130450")->id, *first) << "the second one was withdrawn";
  EXPECT_EQ(snapshot->find("MOS2A45130451"), nullptr)
      << "no file is repaired with legacy constants";
  EXPECT_FAILS(ConstantsSnapshot::parse("{\"serial\": 3}\n"), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::repair
