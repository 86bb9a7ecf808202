#include "repair/rescale/repair_records.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::repair {
namespace {

class Records : public testing::Test {
 protected:
  Records() {
    db::ConstantsRecord record;
    record.serial = "MOS2A1";
    record.filter = "current";
    record.document = "{}";
    constants_ = store_.add_constants(record, "").value();
  }
  RepairReport report(const std::string& name) const {
    RepairReport report;
    report.status = RepairStatus::repaired;
    report.input = name;
    report.serial = "MOS2A1";
    report.input_sha256 = "in-" + name;
    report.output_sha256 = "out-" + name;
    report.method = "store";
    report.constants_id = constants_;
    report.repaired_at = from_unix_seconds(1000);
    return report;
  }

  MemoryEnv memory_;
  db::Store store_ = db::Store::in_memory(memory_.env).value();
  std::string constants_;
};

TEST_F(Records, ARepairIsRecordedWithTheTimeOfItsMark) {
  const auto made = records_of(store_, {report("a")}, "sixpoint 1");
  ASSERT_EQ(made.records.size(), 1U);
  const db::RepairRecord& record = made.records[0];
  EXPECT_EQ(record.made_at, from_unix_seconds(1000));
  EXPECT_EQ(record.input, "a");
  EXPECT_EQ(record.constants_id, constants_);
  EXPECT_EQ(record.software, "sixpoint 1");
}

TEST_F(Records, WhatWroteNoFileIsNotRecorded) {
  auto tried = report("a");
  tried.dry_run = true;
  auto sound = report("b");
  sound.status = RepairStatus::not_affected;
  auto failed = report("c");
  failed.status = RepairStatus::failed;
  EXPECT_TRUE(records_of(store_, {tried, sound, failed}, "").records.empty());
}

TEST_F(Records, AFileIsRecordedOnce) {
  const auto first = records_of(store_, {report("a")}, "1");
  ASSERT_OK(store_.add_repair(first.records.at(0)));
  auto again = report("a");
  again.resumed = true;
  EXPECT_TRUE(records_of(store_, {again}, "2").records.empty());
  EXPECT_EQ(records_of(store_, {again, report("b")}, "2").records.size(), 1U);
}

TEST_F(Records, ConstantsOfAnotherStoreAreNotNamed) {
  auto foreign = report("a");
  foreign.constants_id = "00112233";
  foreign.resumed = true;
  EXPECT_EQ(records_of(store_, {foreign}, "").records.at(0).constants_id, "");
}

TEST_F(Records, AFileThatNoStoreTakesDoesNotStopTheOthers) {
  auto unnamed = report("a");
  unnamed.serial = "";
  const auto made = records_of(store_, {unnamed, report("b")}, "");
  ASSERT_EQ(made.refused.size(), 1U);
  EXPECT_EQ(made.refused[0].path, "a");
  EXPECT_EQ(made.refused[0].error.code, ErrorCode::bad_data);
  EXPECT_EQ(made.records.size(), 1U);
}

}  // namespace
}  // namespace sixpoint::repair
