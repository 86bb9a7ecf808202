// Export: the whole store as JSON Lines or CSV.
#include "db/exchange_fixture.h"

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

}  // namespace
}  // namespace sixpoint::db
