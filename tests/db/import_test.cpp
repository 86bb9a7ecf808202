// Import: what an export says becomes rows again, whole or not at all.
#include <fstream>

#include "db/exchange_fixture.h"
#include "failing_files.h"

namespace sixpoint::db {
namespace {

using testing::HasSubstr;

TEST_F(ExchangeTest, OutAndInAgainKeepsEveryRowAndTheHead) {
  Store first = open("first");
  fill(first);
  const auto out = export_json_lines(first, memory_.files, "a.jsonl");
  ASSERT_OK(out);
  Store second = open("second");
  const auto in = import_json_lines(second, memory_.files, "a.jsonl");
  ASSERT_OK(in);
  EXPECT_EQ(in->added, out->rows);
  const auto audit = second.audit();
  EXPECT_TRUE(audit->ok) << audit->brief();
  EXPECT_EQ(audit->head, first.audit()->head);
  EXPECT_EQ(audit->head, out->head);
  ASSERT_OK(export_json_lines(second, memory_.files, "b.jsonl"));
  EXPECT_EQ(lines("a.jsonl"), lines("b.jsonl"));
}

TEST_F(ExchangeTest, ContinuesAPrefixAndDoesNothingTwice) {
  Store first = open("first");
  fill(first, 1);
  ASSERT_OK(export_json_lines(first, memory_.files, "early.jsonl"));
  fill(first, 5);
  ASSERT_OK(export_json_lines(first, memory_.files, "late.jsonl"));
  Store second = open("second");
  ASSERT_OK(import_json_lines(second, memory_.files, "early.jsonl"));
  const auto more = import_json_lines(second, memory_.files, "late.jsonl");
  ASSERT_OK(more);
  EXPECT_GT(more->added, 0);
  EXPECT_LT(more->added, more->rows);
  const auto again = import_json_lines(second, memory_.files, "late.jsonl");
  ASSERT_OK(again);
  EXPECT_EQ(again->added, 0);
  const auto old = import_json_lines(second, memory_.files, "early.jsonl");
  ASSERT_OK(old);
  EXPECT_EQ(old->added, 0);
  EXPECT_EQ(second.audit()->head, first.audit()->head);
}

TEST_F(ExchangeTest, RefusesAForeignChainAndNamesTheRow) {
  Store first = open("first");
  fill(first);
  ASSERT_OK(export_json_lines(first, memory_.files, "a.jsonl"));
  Store other = open("second");
  ConstantsRecord record;
  record.serial = "MOS2A9";
  record.filter = "current";
  record.document = "{}";
  ASSERT_OK(other.add_constants(record, "w"));
  const auto before = other.audit()->head;
  const auto refused = import_json_lines(other, memory_.files, "a.jsonl");
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_THAT(refused.error().brief(), HasSubstr("row 1 "));
  EXPECT_EQ(other.audit()->head, before);
}

TEST_F(ExchangeTest, RefusesEveryBrokenFileWhole) {
  Store first = open("first");
  fill(first);
  ASSERT_OK(export_json_lines(first, memory_.files, "a.jsonl"));
  const auto good = lines("a.jsonl");
  const std::size_t last = good.size() - 1;
  const auto changed = [&](std::size_t line, const std::string& from, const std::string& to) {
    auto all = good;
    const auto at = all[line].find(from);
    EXPECT_NE(at, std::string::npos) << from << " in " << all[line];
    all[line].replace(at, from.size(), to);
    return all;
  };
  std::vector<std::vector<std::string>> broken;
  broken.push_back({});
  broken.push_back({"{}"});
  broken.emplace_back(good.begin(), good.end() - 1);             // cut off
  broken.push_back(changed(last, "wrong jig", "right jig"));     // changed
  broken.push_back(changed(last, "\"seq\":", "\"seq\":1"));      // renumbered
  broken.push_back(changed(0, "\"rows\":", "\"rows\":1"));       // counts wrong
  broken.push_back(changed(0, "\"head\":\"", "\"head\":\"00"));  // another head
  broken.push_back(changed(1, "\"bytes\":\"", "\"bytes\":\"00"));
  broken.push_back(changed(last, "corrections", "collections"));
  broken.push_back(changed(last, "\"reason\":\"wrong jig\"", "\"reason\":null"));
  broken.push_back(changed(last, "\"reason\":\"wrong jig\"", "\"reason\":17"));
  broken.push_back(changed(last, "\"reason\"", "\"reasons\""));
  broken.push_back(changed(last, "\"hash\":\"", "\"hash\":\"zz"));
  broken.push_back(changed(last, "\"row\":{", "\"row\":[[[[[[[{"));
  for (const char* key : {"seq", "table", "row", "hash"}) {
    const std::string written = std::string("\"") + key + "\":";
    broken.push_back(changed(last, written, "\"other\":"));
    broken.push_back(changed(last, written, written + "[],\"other\":"));
  }
  auto swapped = good;
  std::swap(swapped[last], swapped[last - 1]);
  broken.push_back(swapped);
  auto missing = good;
  missing.erase(missing.begin() + static_cast<std::ptrdiff_t>(last) - 2);
  broken.push_back(missing);
  auto no_attachment = good;
  no_attachment.erase(no_attachment.begin() + 1);
  broken.push_back(no_attachment);
  auto garbage = good;
  garbage[last] = std::string(100'000, '[');
  broken.push_back(garbage);
  Store second = open("second");
  for (std::size_t i = 0; i < broken.size(); ++i) {
    SCOPED_TRACE(i);
    write("broken.jsonl", broken[i]);
    EXPECT_FAILS(import_json_lines(second, memory_.files, "broken.jsonl"), ErrorCode::bad_data);
    const auto audit = second.audit();
    EXPECT_TRUE(audit->ok) << i << ": " << audit->brief();
    EXPECT_EQ(audit->rows, 0) << i << ": nothing half imported";
  }
  write("newer.jsonl", changed(0, "\"store_version\":", "\"store_version\":9"));
  EXPECT_FAILS(import_json_lines(second, memory_.files, "newer.jsonl"), ErrorCode::configuration);
  EXPECT_FAILS(import_json_lines(second, memory_.files, "none.jsonl"), ErrorCode::no_input);
  write("good.jsonl", good);
  EXPECT_OK(import_json_lines(second, memory_.files, "good.jsonl"));
}

TEST_F(ExchangeTest, CsvIsNotImported) {
  Store first = open("first");
  fill(first);
  ASSERT_OK(export_csv(first, memory_.files, "csv"));
  Store second = open("second");
  for (const char* path : {"csv", "csv/constants.csv", "csv/store.json"}) {
    const auto refused = import_json_lines(second, memory_.files, path);
    EXPECT_FAILS(refused, ErrorCode::bad_data);
    EXPECT_THAT(refused.error().hint, HasSubstr("export")) << path;
  }
  EXPECT_FAILS(import_json_lines(second, memory_.files, "none"), ErrorCode::no_input);
  EXPECT_EQ(second.audit()->rows, 0);
}

TEST_F(ExchangeTest, IntoANewFileAnImportIsWholeOrNotThere) {
  Env env{memory_.clock, posix_env().files};
  Store first = open("first");
  fill(first);
  ASSERT_OK(export_json_lines(first, env.files, folder_ / "a.jsonl"));
  ASSERT_OK(export_csv(first, env.files, folder_ / "csv"));
  ASSERT_OK(import_into_new_file(env, folder_ / "a.jsonl", folder_ / "a.db"));
  EXPECT_EQ(Store::open(env, folder_ / "a.db")->audit()->head, first.audit()->head);
  const auto names_before = posix_env().files.list(folder_.path()).value();
  std::ofstream(folder_ / "a.jsonl", std::ios::app) << "{}\n";
  for (const char* input : {"a.jsonl", "csv"}) {
    EXPECT_FAILS(import_into_new_file(env, folder_ / input, folder_ / "new.db"),
                 ErrorCode::bad_data);
  }
  EXPECT_EQ(posix_env().files.list(folder_.path()).value(), names_before)
      << "neither a store nor a temporary file is left";
}

TEST_F(ExchangeTest, ARowThatTheStoreHasMustBeTheSameInTheFile) {
  Store store = open("first");
  fill(store);
  ASSERT_OK(export_json_lines(store, memory_.files, "a.jsonl"));
  const std::string head = store.audit()->head;
  const auto good = lines("a.jsonl");
  const std::size_t last = good.size() - 1;
  for (const auto& [from, to] : {std::pair("\"reason\":\"wrong", "\"reason\":\"right"),
                                 std::pair("\"hash\":\"", "\"hash\":\"00")}) {
    auto all = good;
    all[last].replace(all[last].find(from), std::string(from).size(), to);
    write("changed.jsonl", all);
    const auto refused = import_json_lines(store, memory_.files, "changed.jsonl");
    EXPECT_FAILS(refused, ErrorCode::bad_data);
    EXPECT_THAT(refused.error().what, HasSubstr("is not what the store has in its place"));
    EXPECT_EQ(refused.error().where, "changed.jsonl, line " + std::to_string(good.size()));
    EXPECT_EQ(store.audit()->head, head);
  }
}

TEST_F(ExchangeTest, AFileThatCannotBeReadToItsEndIsNotImported) {
  Store first = open("first");
  fill(first);
  ASSERT_OK(export_json_lines(first, memory_.files, "a.jsonl"));
  sixpoint::tests::FailingFiles files(memory_.files);
  Store second = open("second");
  std::size_t failures = 0;
  for (;; ++failures) {
    files.fail_at(failures);
    const auto report = import_json_lines(second, files, "a.jsonl");
    if (!files.has_failed()) {
      ASSERT_OK(report);
      break;
    }
    EXPECT_FAILS(report, ErrorCode::io);
    EXPECT_EQ(report.error().where, "a.jsonl");
    EXPECT_EQ(second.audit()->rows, 0);
  }
  EXPECT_EQ(failures, 3U) << "open, the whole file, its end";
  EXPECT_EQ(second.audit()->head, first.audit()->head);
}

}  // namespace
}  // namespace sixpoint::db
