// Export: the whole store as JSON Lines or CSV.
#include <algorithm>

#include <nlohmann/json.hpp>

#include "db/exchange_fixture.h"
#include "db/history.h"
#include "failing_files.h"

namespace sixpoint::db {
namespace {

using testing::HasSubstr;

TEST_F(ExchangeTest, AnExportIsWholeOrNotThere) {
  Store store = open("first");
  fill(store);
  const auto before = memory_.files.changing_operations();
  ASSERT_OK(export_json_lines(store, memory_.files, "whole.jsonl"));
  const auto operations = memory_.files.changing_operations() - before;
  const auto whole = lines("whole.jsonl");
  ASSERT_OK(memory_.files.remove("whole.jsonl"));
  for (std::size_t stop = 0; stop < operations; ++stop) {
    memory_.files.fail_after(stop);
    EXPECT_FAILS(export_json_lines(store, memory_.files, "whole.jsonl"), ErrorCode::io);
    memory_.files.stop_failing();
    memory_.files.lose_power();
    if (memory_.files.info("whole.jsonl")) {
      EXPECT_EQ(lines("whole.jsonl"), whole) << stop;
    }
  }
}

TEST_F(ExchangeTest, CsvHasATablePerFileAndTellsNullFromEmpty) {
  Store store = open("first");
  fill(store);
  const auto report = export_csv(store, memory_.files, "csv");
  ASSERT_OK(report);
  EXPECT_EQ(report->attachments, 2);
  const auto bytes = read_file(memory_.files, "csv/runs.csv");
  ASSERT_OK(bytes);
  const std::string text(bytes->begin(), bytes->end());
  EXPECT_THAT(text, testing::StartsWith("seq,id,serial,kind,filter,started_ns,"));
  EXPECT_THAT(text, HasSubstr(",\"Zoë \"\"Z\"\", O'Hara\n\",\"\",\"\",\"\",\"\",,"));
  EXPECT_THAT(text, HasSubstr(",21.5,,"));
  const auto raw = read_file(memory_.files, "csv/attachments/" + to_hex(sha256(Bytes{0, 1, 255})));
  ASSERT_OK(raw);
  EXPECT_EQ(*raw, (Bytes{0, 1, 255}));
}

TEST_F(ExchangeTest, AnExportIsSaidInOneSentenceAndAsJson) {
  Store store = open("first");
  fill(store);
  const auto report = export_json_lines(store, memory_.files, "all.jsonl");
  ASSERT_OK(report);
  const StoreHead head = store.head().value();
  const std::string rows = std::to_string(head.rows);
  EXPECT_EQ(report->brief(), rows + " rows, 2 attachments, head " + head.head);
  EXPECT_EQ(report->to_json().dump(),
            R"({"rows":)" + rows + R"(,"added":0,"attachments":2,"head":")" + head.head + R"("})");
}

TEST_F(ExchangeTest, ALargeCaptureGoesOutAndComesInAgain) {
  Store store = open("first");
  RunRecord run;
  run.serial = "MOS2A1";
  run.filter = "current";
  run.document = "{}";
  ASSERT_OK(store.add_run(run, {{"raw", Bytes(2'000'000, 7)}, {"last", Bytes{8}}}));
  ASSERT_OK(export_json_lines(store, memory_.files, "all.jsonl"));
  Store second = open("second");
  ASSERT_OK(import_json_lines(second, memory_.files, "all.jsonl"));
  EXPECT_EQ(second.audit()->head, store.audit()->head);
}

// Early versions stored the name of a file as it was, also one that is no UTF-8.
TEST_F(ExchangeTest, ATextThatIsNoUtf8GoesOutAndComesInAgain) {
  auto early = Store::in_memory(memory_.env);
  ASSERT_OK(early);
  {
    ConstantsRecord of_unit;
    of_unit.serial = "MOS2A1";
    of_unit.filter = "current";
    of_unit.document = "{}";
    ASSERT_OK(early->add_constants(of_unit, "w"));
    RepairRecord repair;
    repair.serial = "MOS2A1";
    repair.input = "plain";
    repair.document = "{}";
    Row row = rows_of(repair).value().rows.back().second;
    *std::find(row.begin(), row.end(), Value("plain")) = "/a/\xff.gt3x";
    auto transaction = Transaction::writing(early->database());
    auto writer = HistoryWriter::open(early->database()).value();
    ASSERT_OK(writer.append(table("repairs"), row));
    ASSERT_OK(writer.finish());
    ASSERT_OK(transaction->commit());
  }
  ASSERT_OK(export_json_lines(*early, memory_.files, "early.jsonl"));
  EXPECT_THAT(lines("early.jsonl").back(), HasSubstr(R"("input":{"bytes":"2f612fff2e67743378"})"));
  auto second = Store::in_memory(memory_.env);
  ASSERT_OK(import_json_lines(*second, memory_.files, "early.jsonl"));
  EXPECT_EQ(text_of(second->database().query("SELECT input FROM repairs").value()[0][0]),
            "/a/\xff.gt3x");
  EXPECT_EQ(second->audit()->head, early->audit()->head);
  EXPECT_TRUE(second->audit()->ok);
}

TEST_F(ExchangeTest, AStoreThatLacksItsLastRowIsNotExportedAsWhole) {
  Store store = open("first");
  for (int i = 0; i < 2; ++i) {
    ConstantsRecord record;
    record.serial = "MOS2A1";
    record.filter = "current";
    record.made_at = from_unix_seconds(i);
    record.document = "{}";
    ASSERT_OK(store.add_constants(record, "w"));
  }
  place_->tamper("first", "DELETE FROM constants WHERE seq = 4");
  const auto refused = export_json_lines(store, memory_.files, "all.jsonl");
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_THAT(refused.error().what, HasSubstr("should have 4 rows and has 3"));
  EXPECT_EQ(refused.error().where, store.database().location());
  EXPECT_FALSE(memory_.files.info("all.jsonl"));
}

TEST_F(ExchangeTest, AnAttachmentThatWasChangedIsNoCsvExport) {
  Store store = open("first");
  fill(store);
  place_->tamper("first", "UPDATE attachments SET bytes = " + place_->empty_bytes());
  const auto refused = export_csv(store, memory_.files, "csv");
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_THAT(refused.error().what, HasSubstr(to_hex(sha256(Bytes{0, 1, 255}))));
  EXPECT_EQ(refused.error().where, store.database().location());
  EXPECT_FALSE(memory_.files.info("csv/store.json")) << "the mark of a whole export";
}

// Where store.json is there, the tables beside it are of the same export.
TEST_F(ExchangeTest, ACsvExportOverAnEarlierOneIsNeverMixedWithIt) {
  Store small = open("small");
  fill(small, 1);
  Store large = open("large");
  fill(large, 3);
  sixpoint::tests::FailingFiles files(memory_.files);
  const auto content = [&](const std::string& folder) {
    return std::pair(lines(folder + "/store.json"), lines(folder + "/constants.csv"));
  };
  ASSERT_OK(export_csv(small, memory_.files, "small"));
  ASSERT_OK(export_csv(large, memory_.files, "large"));
  std::size_t failures = 0;
  for (;; ++failures) {
    const std::string folder = "csv" + std::to_string(failures);
    ASSERT_OK(export_csv(small, memory_.files, folder));
    files.fail_at(failures);
    const auto report = export_csv(large, files, folder);
    if (!files.has_failed()) {
      ASSERT_OK(report);
      EXPECT_EQ(content(folder), content("large"));
      break;
    }
    EXPECT_FAILS(report, ErrorCode::io);
    if (memory_.files.info(folder + "/store.json")) {
      EXPECT_THAT(content(folder), testing::AnyOf(content("small"), content("large"))) << failures;
    }
  }
  EXPECT_GT(failures, 20U);
}

}  // namespace
}  // namespace sixpoint::db
