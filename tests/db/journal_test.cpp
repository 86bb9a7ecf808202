#include "db/journal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/forwarding_files.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "failing_files.h"
#include "place.h"
#include "temporary_folder.h"

namespace sixpoint::db {
namespace {

class JournalTest : public testing::Test {
 protected:
  Store open_store(const std::string& name) {
    return Store::open(memory_.env, place_->location(name)).value();
  }
  Journal open_journal() { return Journal::open(memory_.files, "journal").value(); }

  static RunRecord run(int number) {
    RunRecord run;
    run.serial = "MOS2A1";
    run.kind = "jig";
    run.filter = "current";
    run.operator_name = "Zoë";
    run.started = from_unix_seconds(number);
    run.document = "{}";
    run.temperature_c = 21.3;
    run.codes = {"tilted"};
    run.jig_due = from_unix_seconds(99);
    return run;
  }
  static ConstantsRecord constants(int number, const std::string& run_id) {
    ConstantsRecord record;
    record.serial = "MOS2A1";
    record.filter = "current";
    record.made_at = from_unix_seconds(number);
    record.run_id = run_id;
    record.document = R"({"made_from":{"n":1}})";
    return record;
  }

  std::unique_ptr<tests::Place> place_ = tests::make_place();
  MemoryEnv memory_;
};

// One unit's work, into anything that has the store's four functions.
template <class Target>
std::vector<std::string> work(Target& target, const std::vector<RunRecord>& runs,
                              ConstantsRecord (*constants)(int, const std::string&)) {
  std::vector<std::string> ids;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    ids.push_back(
        target.add_run(runs[i], {{"raw", Bytes{1, 2, static_cast<std::uint8_t>(i)}}}).value());
    ids.push_back(
        target.add_unit_write({ids.back(), "MOS2A1", from_unix_seconds(5), "null", "{}", "{}"})
            .value());
    ids.push_back(
        target.add_constants(constants(static_cast<int>(i), ids[ids.size() - 2]), "w").value());
    RepairRecord repair;
    repair.serial = "MOS2A1";
    repair.input = "/a/\xff.gt3x";
    repair.constants_id = ids.back();
    repair.document = "{}";
    ids.push_back(target.add_repair(repair).value());
  }
  return ids;
}

TEST_F(JournalTest, CaughtUpTheStoreIsAsIfItsServerHadNeverBeenAway) {
  const std::vector<RunRecord> runs = {run(1), run(2), run(3)};
  Store direct = open_store("direct");
  const auto expected = work(direct, runs, constants);
  Journal journal = open_journal();
  EXPECT_EQ(work(journal, runs, constants), expected) << "the same ids";
  EXPECT_EQ(journal.pending().value(), expected.size());
  memory_.files.lose_power();
  Journal later = open_journal();
  Store store = open_store("late");
  const auto taken = later.catch_up(store);
  ASSERT_OK(taken);
  EXPECT_EQ(*taken, expected.size());
  EXPECT_EQ(later.pending().value(), 0U);
  EXPECT_EQ(store.audit()->head, direct.audit()->head) << "every row the same, in the same order";
  EXPECT_EQ(later.catch_up(store).value(), 0U);
}

TEST_F(JournalTest, APowerCutAtAnyOperationLosesAndDoublesNothing) {
  const std::vector<RunRecord> runs = {run(1), run(2)};
  Store direct = open_store("direct");
  work(direct, runs, constants);
  const auto head = direct.audit()->head;
  const auto rows = direct.audit()->rows;
  std::size_t stops = 0;
  // While entries are written: what was acknowledged is there, and only that or one more.
  for (std::size_t stop = 0;; ++stop, ++stops) {
    MemoryEnv machine;
    auto journal = Journal::open(machine.files, "journal");
    machine.files.fail_after(stop);
    std::size_t acknowledged = 0;
    for (int i = 0; i < 3; ++i) {
      acknowledged += journal->add_run(run(i), {{"raw", Bytes{9}}}) ? 1 : 0;
    }
    machine.files.lose_power();
    machine.files.stop_failing();
    auto again = Journal::open(machine.files, "journal");
    const auto pending = again->pending();
    ASSERT_OK(pending);
    EXPECT_GE(*pending, acknowledged);
    EXPECT_LE(*pending, acknowledged + 1);
    if (acknowledged == 3) {
      break;
    }
  }
  EXPECT_GT(stops, 10U);
  // While the store catches up: after the next try it has everything once, in order.
  Store store = open_store("late");
  for (std::size_t stop = 0;; ++stop) {
    MemoryEnv machine;
    auto journal = Journal::open(machine.files, "journal");
    work(*journal, runs, constants);
    machine.files.fail_after(stop);
    const bool whole = journal->catch_up(store).has_value();
    machine.files.lose_power();
    machine.files.stop_failing();
    auto again = Journal::open(machine.files, "journal");
    ASSERT_OK(again->catch_up(store));
    EXPECT_EQ(again->pending().value(), 0U);
    EXPECT_EQ(store.audit()->head, head) << stop;
    EXPECT_EQ(store.audit()->rows, rows);
    if (whole) {
      EXPECT_GT(stop, 10U);
      break;
    }
  }
}

TEST_F(JournalTest, SaysWhetherItHoldsARecord) {
  const auto holds = [&](const std::string& id) {
    return Journal::holds(memory_.files, "journal", id).value();
  };
  const std::string id(32, 'a');
  EXPECT_FALSE(holds(id)) << "and makes no folder";
  EXPECT_FALSE(memory_.files.info("journal"));
  Journal journal = open_journal();
  const auto added = journal.add_constants(constants(1, ""), "w");
  ASSERT_OK(added);
  EXPECT_TRUE(holds(*added));
  EXPECT_FALSE(holds(id));
  EXPECT_FALSE(holds(""));
  Store store = open_store("late");
  ASSERT_OK(journal.catch_up(store));
  EXPECT_FALSE(holds(*added)) << "the store has it now";
}

TEST_F(JournalTest, KeepsTheOrderWhenAnEntryIsDamagedOrRefused) {
  Journal journal = open_journal();
  ASSERT_OK(journal.add_constants(constants(1, ""), "w"));
  auto of_no_run = constants(2, "no such run");
  ASSERT_OK(journal.add_constants(of_no_run, "w"));
  ASSERT_OK(journal.add_constants(constants(3, ""), "w"));
  Store store = open_store("main");
  EXPECT_FAILS(journal.catch_up(store), ErrorCode::bad_data);
  EXPECT_EQ(journal.pending().value(), 2U) << "the refused one and the one behind it";
  EXPECT_EQ(store.history("MOS2A1")->size(), 1U);
  auto broken = constants(4, "");
  broken.document = "{";
  EXPECT_FAILS(journal.add_constants(broken, "w"), ErrorCode::bad_data);
  EXPECT_EQ(journal.pending().value(), 2U) << "what the store would refuse is refused at once";

  const auto names = memory_.files.list("journal");
  ASSERT_OK(memory_.files.remove("journal/" + names->front()));
  auto damaged = memory_.files.create("journal/" + names->front());
  const std::string text = R"({"schema":"sixpoint/journal-entry/1","record":"{}","sha256":"00"})";
  ASSERT_OK((*damaged)->write_at(0, as_bytes(text)));
  const auto refused = journal.catch_up(store);
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_THAT(refused.error().brief(), testing::HasSubstr(names->front()));
  ASSERT_OK(memory_.files.remove("journal/" + names->front()));
  const auto rest = journal.catch_up(store);
  ASSERT_OK(rest);
  EXPECT_EQ(*rest, 1U);
}

class OldJournalTest : public JournalTest {
 protected:
  // A file as the program wrote it before version 2 of the journal.
  void write_entry(int number, const nlohmann::ordered_json& record) {
    const std::string text = record.dump();
    const nlohmann::ordered_json line = {
        {"schema", "sixpoint/journal-entry/1"}, {"sha256", text_sha256(text)}, {"record", text}};
    ASSERT_OK(write_file(memory_.files, "journal/000000000" + std::to_string(number) + "-x.json",
                         line.dump() + "\n"));
  }
};

TEST_F(OldJournalTest, EveryKindOfEntryIsRead) {
  Journal journal = open_journal();
  RunRecord measured = run(1);
  measured.model = "w";
  measured.gravity_m_per_s2 = 9.0;
  Store direct = open_store("direct");
  const std::string id = direct.add_run(measured, {{"raw", Bytes{1, 255}}}).value();
  ASSERT_OK(direct.add_unit_write({id, "MOS2A1", from_unix_seconds(5), "null", "{}", "{}"}));
  const std::string constants_id = direct.add_constants(constants(2, id), "w").value();
  RepairRecord repair;
  repair.serial = "MOS2A1";
  repair.made_at = from_unix_seconds(7);
  repair.input = "/a/b.gt3x";
  repair.input_sha256 = "11";
  repair.output_sha256 = "22";
  repair.method = "store";
  repair.constants_id = constants_id;
  repair.document = "{}";
  ASSERT_OK(direct.add_repair(repair));

  write_entry(1, {{"kind", "run"},
                  {"serial", "MOS2A1"},
                  {"model", "w"},
                  {"run_kind", "jig"},
                  {"filter", "current"},
                  {"started_ns", 1'000'000'000},
                  {"ended_ns", 0},
                  {"operator", "Zo\xc3\xab"},
                  {"station", ""},
                  {"jig", ""},
                  {"verdict", ""},
                  {"software", ""},
                  {"retest_of", ""},
                  {"document", "{}"},
                  {"jig_due_ns", 99'000'000'000},
                  {"build", ""},
                  {"limits", ""},
                  {"gravity_m_per_s2", 9.0},
                  {"temperature_c", 21.3},
                  {"codes", {"tilted"}},
                  {"captures", {{{"name", "raw"}, {"bytes", "01ff"}}}}});
  write_entry(2, {{"kind", "unit_write"},
                  {"run_id", id},
                  {"serial", "MOS2A1"},
                  {"written_ns", 5'000'000'000},
                  {"as_found", "null"},
                  {"as_left", "{}"},
                  {"read_back", "{}"}});
  write_entry(3, {{"kind", "constants"},
                  {"model", "w"},
                  {"serial", "MOS2A1"},
                  {"filter", "current"},
                  {"made_at_ns", 2'000'000'000},
                  {"method", ""},
                  {"run_id", id},
                  {"document", R"({"made_from":{"n":1}})"}});
  write_entry(4, {{"kind", "repair"},
                  {"serial", "MOS2A1"},
                  {"made_at_ns", 7'000'000'000},
                  {"input", "/a/b.gt3x"},
                  {"input_sha256", "11"},
                  {"output_sha256", "22"},
                  {"method", "store"},
                  {"constants_id", constants_id},
                  {"document", "{}"},
                  {"software", ""}});
  Store store = open_store("late");
  const auto taken = journal.catch_up(store);
  ASSERT_OK(taken);
  EXPECT_EQ(*taken, 4U);
  EXPECT_EQ(store.audit()->head, direct.audit()->head) << "the same rows, to the bit";
}

TEST_F(OldJournalTest, AnEntryThatLacksAKeyOrIsOfNoKnownKindIsRefused) {
  Journal journal = open_journal();
  Store store = open_store("main");
  const nlohmann::ordered_json bad[] = {
      {{"kind", "run"}, {"serial", "MOS2A1"}},
      {{"kind", "correction"}},
      {{"kind", 3}},
      {{"kind", "run"},
       {"model", "w"},
       {"serial", "MOS2A1"},
       {"run_kind", "jig"},
       {"filter", "current"},
       {"started_ns", 1},
       {"ended_ns", 1},
       {"operator", ""},
       {"station", ""},
       {"jig", ""},
       {"verdict", ""},
       {"software", ""},
       {"document", "{}"},
       {"captures", {{{"name", "raw"}, {"bytes", "no hex"}}}}},
      {{"kind", "unit_write"}, {"serial", 1}},
      {{"kind", "repair"}, {"serial", "MOS2A1"}, {"made_at_ns", "now"}},
      {{"id", "x"},
       {"rows", nullptr},
       {"attachments", {{{"attachment", "the name of other bytes"}, {"bytes", "00"}}}}},
      // The id is not the one that the content has.
      {{"id", "x"},
       {"rows",
        {{{"table", "captures"},
          {"row", {{"id", "x"}, {"run_id", "r"}, {"name", "raw"}, {"sha256", "00"}}}}}},
       {"attachments", nullptr}},
      {{"id", "x"}, {"rows", {{{"table", "none"}, {"row", nullptr}}}}, {"attachments", nullptr}},
      {{"id", "x"},
       {"rows",
        {{{"table", "units"}, {"row", {{"serial", ""}, {"model", "w"}, {"first_seen_ns", 1}}}}}},
       {"attachments", nullptr}}};
  for (const auto& record : bad) {
    write_entry(1, record);
    EXPECT_FAILS(journal.catch_up(store), ErrorCode::bad_data);
    EXPECT_EQ(journal.pending().value(), 1U);
    ASSERT_OK(memory_.files.remove("journal/0000000001-x.json"));
  }
  EXPECT_EQ(store.audit()->rows, 0);
}

// Found by the fuzzer: a time that fits no 64 bits, under a checksum that holds.
TEST_F(JournalTest, ATimeBeyondAllTimesIsRefused) {
  Journal journal = open_journal();
  const std::string record =
      R"({"kind":"constants","model":"w","serial":"MOS2A1","filter":"current","made_at_ns":1e80,)"
      R"("method":"ls","run_id":"","document":"{}"})";
  const std::string line =
      nlohmann::json{{"record", record}, {"sha256", text_sha256(record)}}.dump();
  auto file = memory_.files.create("journal/0000000001-x.json");
  ASSERT_OK((*file)->write_at(0, as_bytes(line)));
  Store store = open_store("main");
  EXPECT_FAILS(journal.catch_up(store), ErrorCode::bad_data);
  EXPECT_EQ(store.audit()->rows, 0);
}

TEST_F(JournalTest, AFileThatIsNoEntryIsRefusedByItsName) {
  Journal journal = open_journal();
  Store store = open_store("main");
  const std::string path = "journal/0000000001-x.json";
  for (const char* text : {"", "[]", "{}", R"({"record":"{}"})", R"({"record":{},"sha256":"00"})",
                           R"({"record":"{}","sha256":"00"})", R"({"record":"{}","sha256":0})"}) {
    SCOPED_TRACE(text);
    ASSERT_OK(write_file(memory_.files, path, text));
    const auto refused = journal.catch_up(store);
    EXPECT_FAILS(refused, ErrorCode::bad_data);
    EXPECT_EQ(refused.error().where, path);
    EXPECT_THAT(refused.error().hint, testing::HasSubstr("do not delete it"));
    EXPECT_TRUE(memory_.files.info(path).has_value());
  }
  EXPECT_EQ(store.audit()->rows, 0);
}

TEST_F(JournalTest, WhateverCallOfTheDiskFailsTheStoreHasEveryRunOnceInTheEnd) {
  sixpoint::tests::FailingFiles files(memory_.files);
  Store store = open_store("main");
  const std::string folder = "a/journal";
  std::size_t runs = 0;
  std::size_t failures = 0;
  // Until no call is left to fail, of those that write an entry and those that give it to the
  // store.
  for (bool failed = true; failed; ++failures) {
    files.fail_at(failures);
    auto journal = Journal::open(files, folder);
    const auto added =
        journal ? journal->add_run(run(static_cast<int>(failures)), {}) : fail(journal.error());
    const auto taken = added ? journal->catch_up(store) : fail(added.error());
    failed = files.has_failed();
    EXPECT_EQ(taken.has_value(), !failed) << failures;
    files.stop_failing();
    runs += added ? 1 : 0;
    auto again = Journal::open(files, folder);
    ASSERT_OK(again);
    const std::size_t pending = again->pending().value();
    ASSERT_OK(again->catch_up(store));
    const std::size_t stored = store.unit_history("MOS2A1").value().runs.size();
    EXPECT_GE(stored, runs) << failures;
    EXPECT_LE(stored, runs + (added ? 0 : 1)) << failures;
    EXPECT_LE(pending, 1U);
    runs = stored;
  }
  EXPECT_GT(failures, 8U);
}

// Another program gives entries to the store at the same time: the first one between this program's
// look at the folder and its reading, the second between its reading and its removal.
class SharedFolder final : public sixpoint::ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Result<std::vector<std::string>> list(const std::string& folder) override {
    auto names = ForwardingFiles::list(folder);
    SIXPOINT_CHECK(ForwardingFiles::remove(folder + "/" + names.value().front()));
    return names;
  }
  Status remove(const std::string& path) override {
    SIXPOINT_CHECK(ForwardingFiles::remove(path));
    return ForwardingFiles::remove(path);
  }
};

TEST_F(JournalTest, AnEntryThatAnotherProgramGaveToTheStoreIsNoError) {
  {
    Journal journal = open_journal();
    ASSERT_OK(journal.add_run(run(1), {}));
    ASSERT_OK(journal.add_run(run(2), {}));
  }
  SharedFolder files(memory_.files);
  Store store = open_store("main");
  const auto taken = Journal::open(files, "journal").value().catch_up(store);
  ASSERT_OK(taken);
  EXPECT_EQ(*taken, 1U);
  const auto runs = store.unit_history("MOS2A1").value().runs;
  ASSERT_EQ(runs.size(), 1U);
  EXPECT_EQ(runs[0].started, from_unix_seconds(2));
  EXPECT_EQ(open_journal().pending().value(), 0U);
}

// No entry is passed over but one that is gone: those behind it would come before it.
TEST_F(JournalTest, AnEntryThatIsThereAndCannotBeOpenedStopsTheCatchingUp) {
  const sixpoint::tests::TemporaryFolder folder;
  auto journal = Journal::open(posix_env().files, folder.path()).value();
  ASSERT_OK(posix_env().files.make_folders(folder / "0000000001-ab.json"));
  ASSERT_OK(journal.add_run(run(1), {}));
  Store store = open_store("main");
  const auto refused = journal.catch_up(store);
  EXPECT_FAILS(refused, ErrorCode::no_input);
  EXPECT_EQ(refused.error().where, folder / "0000000001-ab.json");
  EXPECT_EQ(store.audit()->rows, 0);
}

// Numbers go on behind the highest one, whatever else sorts behind it.
TEST_F(JournalTest, AFileOfAnotherNameDoesNotChangeTheOrder) {
  Journal journal = open_journal();
  ASSERT_OK(journal.add_run(run(1), {}));
  ASSERT_OK(memory_.files.rename("journal/" + memory_.files.list("journal")->front(),
                                 "journal/bad-0000000001-ab.json"));
  ASSERT_OK(write_file(memory_.files, "journal/0000000041-cd.json", ""));
  for (int number = 2; number < 8; ++number) {
    ASSERT_OK(journal.add_run(run(number), {}));
    EXPECT_THAT(*memory_.files.list("journal"),
                testing::Contains(testing::StartsWith("00000000" + std::to_string(number + 40))));
  }
}

}  // namespace
}  // namespace sixpoint::db
