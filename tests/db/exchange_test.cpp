#include "db/exchange.h"

#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "db/store.h"
#include "expect_result.h"
#include "place.h"

namespace sixpoint::db {
namespace {

using testing::HasSubstr;

class ExchangeTest : public testing::Test {
 protected:
  Store open(const std::string& name) {
    auto store = Store::open(memory_.env, place_->location(name));
    if (!store) {
      throw std::runtime_error(store.error().brief());
    }
    return *std::move(store);
  }

  // A little of everything: NULLs, empty texts, an attachment, a withdrawal.
  static void fill(Store& store, int constants = 3) {
    RunRecord run;
    run.serial = "MOS2A1";
    run.kind = "jig";
    run.filter = "current";
    run.operator_name = "Zoë \"Z\", O'Hara\n";
    run.document = R"({"a":[1,2.5,"x"]})";
    run.temperature_c = 21.5;
    ASSERT_OK(store.add_run(run, {{"raw", Bytes{0, 1, 255}}, {"empty", Bytes{}}}));
    std::string last;
    for (int i = 0; i < constants; ++i) {
      ConstantsRecord record;
      record.serial = "MOS2A1";
      record.filter = i % 2 == 0 ? "current" : "legacy";
      record.made_at = from_unix_seconds(i);
      record.document = R"({"made_from":{"n":1}})";
      const auto id = store.add_constants(record, "w");
      ASSERT_OK(id);
      last = *id;
    }
    ASSERT_OK(store.withdraw_constants(last, "Ada", "wrong jig"));
  }

  std::vector<std::string> lines(const std::string& path) {
    const auto bytes = read_file(memory_.files, path);
    std::istringstream text(std::string(bytes->begin(), bytes->end()));
    std::vector<std::string> all;
    for (std::string line; std::getline(text, line);) {
      all.push_back(line);
    }
    return all;
  }
  void write(const std::string& path, const std::vector<std::string>& all) {
    std::string text;
    for (const std::string& line : all) {
      text += line + "\n";
    }
    ASSERT_OK(write_file_again(path, text));
  }
  Status write_file_again(const std::string& path, const std::string& text) {
    if (memory_.files.info(path)) {
      SIXPOINT_CHECK(memory_.files.remove(path));
    }
    SIXPOINT_ASSIGN(auto file, memory_.files.create(path));
    return file->write_at(0, as_bytes(text));
  }

  std::unique_ptr<tests::Place> place_ = tests::make_place();
  MemoryEnv memory_;
  sixpoint::tests::TemporaryFolder folder_;
};

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

TEST_F(ExchangeTest, ABackupIsAStoreWithTheSameHead) {
  Store store = open("first");
  fill(store);
  const std::string path = folder_ / "backup.db";
  for (int round = 0; round < 2; ++round) {
    Env env{memory_.clock, posix_env().files};
    const auto report = backup(store, env, path);
    ASSERT_OK(report);
    EXPECT_EQ(report->attachments, 2);
    auto copy = Store::open(memory_.env, path);
    ASSERT_OK(copy);
    const auto audit = copy->audit();
    EXPECT_TRUE(audit->ok) << audit->brief();
    EXPECT_EQ(audit->head, store.audit()->head);
    EXPECT_EQ(report->head, audit->head);
    fill(store, 6);
  }
  const auto names = posix_env().files.list(folder_.path());
  EXPECT_THAT(*names, testing::ElementsAre("backup.db")) << "nothing else is left beside it";
  Env env{memory_.clock, posix_env().files};
  EXPECT_FAILS(backup(store, env, folder_ / "none/backup.db"), ErrorCode::cannot_create);
}

}  // namespace
}  // namespace sixpoint::db
