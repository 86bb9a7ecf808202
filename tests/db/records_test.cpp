#include "db/records.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/sha256.h"
#include "db/name_rule.h"
#include "expect_result.h"
#include "store_fixture.h"

namespace sixpoint::db {
namespace {

RunRecord run() {
  RunRecord run = jig_run("MOS2A1");
  run.model = "wGT3XBT";
  run.started = from_unix_seconds(10);
  run.ended = from_unix_seconds(20);
  run.temperature_c = 21.5;
  run.codes = {"tilted", "noisy"};
  return run;
}

std::vector<std::string> tables_of(const NewRows& rows) {
  std::vector<std::string> names;
  for (const auto& [table, row] : rows.rows) {
    names.emplace_back(table->name);
  }
  return names;
}

TEST(Records, ARunBringsItsUnitItsFilterAndItsCaptures) {
  const auto rows = rows_of(run(), {{"raw", Bytes{1, 2}}});
  ASSERT_OK(rows);
  EXPECT_THAT(tables_of(*rows),
              testing::ElementsAre("units", "filter_configurations", "runs", "captures"));
  const Row& unit = rows->rows[0].second;
  EXPECT_EQ(unit,
            (Row{std::string("MOS2A1"), std::string("wGT3XBT"), std::int64_t{10'000'000'000}}));
  const Row& row = rows->rows[2].second;
  EXPECT_EQ(text_of(row[0]), rows->id);
  EXPECT_EQ(rows->id.size(), 32U);
  EXPECT_EQ(row[4], Value(std::int64_t{10'000'000'000}));
  EXPECT_EQ(row[11], Value()) << "no retest_of";
  EXPECT_EQ(row[12], Value(std::string("{}")));
  EXPECT_EQ(row[17], Value(std::string("21.5")));
  EXPECT_EQ(row[18], Value(std::string(R"(["tilted","noisy"])")));
  ASSERT_EQ(rows->attachments.size(), 1U);
  EXPECT_EQ(rows->attachments[0].first, to_hex(sha256(Bytes{1, 2})));
}

TEST(Records, ARowIsTheRecordAgain) {
  const auto rows = rows_of(run(), {});
  ASSERT_OK(rows);
  const auto back = record_of<RunRecord>(rows->rows[2].second);
  EXPECT_EQ(back.id, rows->id);
  EXPECT_EQ(back.serial, "MOS2A1");
  EXPECT_EQ(back.ended, from_unix_seconds(20));
  EXPECT_FALSE(back.jig_due);
  EXPECT_EQ(back.temperature_c, 21.5);
  EXPECT_FALSE(back.gravity_m_per_s2);
  EXPECT_EQ(back.codes, run().codes);
}

TEST(Records, AnIdChangesWithTheContentAndNotWithTheModel) {
  const std::string id = rows_of(run(), {})->id;
  RunRecord other = run();
  other.model = "GT9X";
  EXPECT_EQ(rows_of(other, {})->id, id) << "the model is the unit's";
  other.station = "B";
  EXPECT_NE(rows_of(other, {})->id, id);
}

TEST(Records, UncertaintyAndOriginComeFromTheDocument) {
  ConstantsRecord record;
  record.serial = "MOS2A1";
  record.filter = "legacy";
  record.document = R"({"standard_uncertainty":{"zero_mg":[1,2,3]},"made_from":{"n":1}})";
  const auto rows = rows_of(record, "");
  ASSERT_OK(rows);
  const Row& row = rows->rows[2].second;
  EXPECT_EQ(text_of(row[7]), R"({"zero_mg":[1,2,3]})");
  EXPECT_EQ(text_of(row[8]), R"({"n":1})");
  record.origin = "something else";
  EXPECT_EQ(rows_of(record, "")->id, rows->id);
}

TEST(Records, RefusesWhatAColumnMayNotHold) {
  const auto refused = [](auto change) {
    RunRecord bad = run();
    change(bad);
    EXPECT_FAILS(rows_of(bad, {}), ErrorCode::bad_data);
  };
  refused([](RunRecord& r) { r.serial = ""; });
  refused([](RunRecord& r) { r.serial = "MOS\n"; });
  refused([](RunRecord& r) { r.serial = std::string(201, 'M'); });
  refused([](RunRecord& r) { r.filter = "Legacy"; });
  refused([](RunRecord& r) { r.document = "{"; });
  refused([](RunRecord& r) { r.limits = "{"; });
  refused([](RunRecord& r) { r.station = "\xff"; });
  refused([](RunRecord& r) { r.station = std::string("a\0b", 3); });
  refused([](RunRecord& r) { r.model = std::string(201, 'm'); });
  refused([](RunRecord& r) { r.codes = {"\xed\xa0\x80"}; });  // a surrogate
  refused([](RunRecord& r) { r.codes = {std::string(2001, 'c')}; });
  refused([](RunRecord& r) { r.document = std::string(1, '\0'); });
  RunRecord longest = run();
  longest.serial = std::string(200, 'M');
  EXPECT_OK(rows_of(longest, {}));
}

// Oracle: what the row itself takes.
TEST(Records, ANameIsCheckedBeforehandByTheRuleOfTheRow) {
  for (const std::string& name :
       {std::string(), std::string("Zo\xc3\xab"), std::string(200, 'x'), std::string(201, 'x'),
        std::string("A\0da", 4), std::string("A\xff")}) {
    RunRecord named = run();
    named.operator_name = name;
    EXPECT_EQ(check_name(name).has_value(), rows_of(named, {}).has_value()) << printable(name);
  }
  EXPECT_FAILS(check_name(std::string("A\0da", 4)), ErrorCode::bad_data);
}

// The first and the last characters of each length, and the bytes beside them (RFC 3629, 4).
TEST(Records, ATextIsUtf8) {
  RunRecord named = run();
  for (const char* good :
       {"\x7f", "\xc2\x80", "\xdf\xbf", "\xe0\xa0\x80", "\xed\x9f\xbf", "\xee\x80\x80",
        "\xef\xbf\xbf", "\xf0\x90\x80\x80", "\xf4\x8f\xbf\xbf"}) {
    named.station = good;
    EXPECT_OK(rows_of(named, {}));
  }
  for (const char* bad :
       {"\x80", "\xc1\xbf", "\xc2\x7f", "\xc2\xc0", "\xe0\x9f\xbf", "\xed\xa0\x80", "\xef\xbf\xc0",
        "\xf0\x8f\xbf\xbf", "\xf4\x90\x80\x80", "\xf5\x80\x80\x80", "\xf0\x90\x80"}) {
    named.station = bad;
    EXPECT_FAILS(rows_of(named, {}), ErrorCode::bad_data);
  }
}

TEST(Records, ACaptureAbove100MiBIsRefusedByItsName) {
  const auto refused = rows_of(run(), {{"long one", Bytes((100U << 20) + 1)}});
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_THAT(refused.error().what, testing::HasSubstr("long one has 104857601 bytes"));
  EXPECT_THAT(refused.error().hint, testing::HasSubstr("104857600"));
}

TEST(Records, ARowHasTheColumnsOfItsTable) {
  EXPECT_FAILS(new_row(table("units"), Row(2, std::string("a"))), ErrorCode::internal);
  const auto none = new_row(table("units"), {Value(), std::string("w"), std::int64_t{1}});
  EXPECT_FAILS(none, ErrorCode::bad_data);
  EXPECT_THAT(none.error().what, testing::HasSubstr("serial"));
  const auto text = new_row(table("units"), {std::string("M"), std::string("w"), std::string("1")});
  EXPECT_FAILS(text, ErrorCode::bad_data);
  EXPECT_THAT(text.error().what, testing::HasSubstr("first_seen_ns"));
}

// What only another program can have written there.
TEST(Records, CodesOfAnotherFormAreReadAsFarAsTheyGo) {
  Row row = rows_of(run(), {})->rows[2].second;
  row[18] = std::string(R"(["tilted",7])");
  EXPECT_EQ(record_of<RunRecord>(row).codes, (std::vector<std::string>{"tilted", "7"}));
  row[18] = std::string("{}");
  EXPECT_TRUE(record_of<RunRecord>(row).codes.empty());
}

TEST(Records, APathOfAnyBytesCanBeStored) {
  EXPECT_EQ(storable_path("/a/Zo\xc3\xab.gt3x"), "/a/Zo\xc3\xab.gt3x");
  EXPECT_EQ(storable_path("/a/\xff\n.gt3x"), "/a/\\xff\\x0a.gt3x");
}

}  // namespace
}  // namespace sixpoint::db
