#include "db/save.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/forwarding_files.h"
#include "base/memory_env.h"
#include "db/journal.h"
#include "expect_result.h"
#include "place.h"

namespace sixpoint::db {
namespace {

using testing::HasSubstr;

class SaveTest : public testing::Test {
 protected:
  Result<Store> open(const std::string& name) {
    return Store::open(memory_.env, place_->location(name));
  }
  static Result<Store> refused(ErrorCode code) { return fail(code, "no", "there", "try"); }

  // A run, what it wrote into the unit, and its constants.
  static std::function<Status(RecordWriter&)> work(int number) {
    return [number](RecordWriter& writer) -> Status {
      RunRecord run;
      run.serial = "MOS2A1";
      run.kind = "jig";
      run.filter = "current";
      run.started = from_unix_seconds(number);
      run.document = "{}";
      SIXPOINT_ASSIGN(const std::string id, writer.add_run(run, {{"raw", Bytes{1, 2}}}));
      SIXPOINT_CHECK(
          writer.add_unit_write({id, "MOS2A1", from_unix_seconds(number), "null", "{}", "{}"}));
      ConstantsRecord constants;
      constants.serial = "MOS2A1";
      constants.filter = "current";
      constants.made_at = from_unix_seconds(number);
      constants.run_id = id;
      constants.document = "{}";
      SIXPOINT_CHECK(writer.add_constants(constants, "w"));
      return {};
    };
  }
  Result<Saved> keep_on(Result<Store>& store, int number) {
    return save(memory_.files, store, places_, work(number));
  }
  std::size_t pending(const std::string& folder) {
    return Journal::open(memory_.files, folder).value().pending().value();
  }

  std::unique_ptr<tests::Place> place_ = tests::make_place();
  MemoryEnv memory_;
  SavePlaces places_{"journal", {"last", "very-last"}};
};

TEST_F(SaveTest, AStoreThatTakesItNeedsNoJournal) {
  auto store = open("main");
  const auto kept = keep_on(store, 1);
  ASSERT_OK(kept);
  EXPECT_TRUE(kept->in_store());
  EXPECT_FALSE(kept->refusal.has_value());
  EXPECT_FALSE(memory_.files.info("journal").has_value());
  EXPECT_EQ(store->history("MOS2A1")->size(), 1U);
}

TEST_F(SaveTest, WhateverTheStoreAnswersNothingIsLostAndTheOrderIsKept) {
  auto direct = open("direct");
  int number = 0;
  for (const ErrorCode code :
       {ErrorCode::device_unavailable, ErrorCode::permission, ErrorCode::io, ErrorCode::bad_data,
        ErrorCode::configuration, ErrorCode::cannot_create, ErrorCode::no_input,
        ErrorCode::internal}) {
    auto store = refused(code);
    const auto kept = keep_on(store, ++number);
    ASSERT_OK(kept);
    EXPECT_EQ(kept->folder, "journal");
    EXPECT_FALSE(kept->last_resort);
    ASSERT_TRUE(kept->refusal.has_value());
    EXPECT_EQ(kept->refusal->code, code);
    ASSERT_OK(work(number)(*direct));
  }
  memory_.files.lose_power();
  EXPECT_EQ(pending("journal"), 3U * static_cast<unsigned>(number));
  auto store = open("main");
  const auto kept = keep_on(store, ++number);
  ASSERT_OK(kept);
  EXPECT_TRUE(kept->in_store());
  EXPECT_EQ(kept->caught_up, 3U * static_cast<unsigned>(number - 1));
  ASSERT_OK(work(number)(*direct));
  EXPECT_EQ(store->audit()->head, direct->audit()->head)
      << "as if the store had taken every run at once";
}

TEST_F(SaveTest, AStoreThatGivesUpHalfWayIsGivenTheRestOnce) {
  auto store = open("main");
  auto direct = open("direct");
  ASSERT_OK(work(1)(*direct));
  bool gone = true;
  const auto kept = save(memory_.files, store, places_, [&](RecordWriter& writer) -> Status {
    if (std::exchange(gone, false)) {
      // The store took everything, and its last answer was lost.
      SIXPOINT_CHECK(work(1)(writer));
      return fail(ErrorCode::device_unavailable, "the server went away", "there", "wait");
    }
    return work(1)(writer);
  });
  ASSERT_OK(kept);
  EXPECT_EQ(kept->folder, "journal");
  auto journal = Journal::open(memory_.files, "journal");
  ASSERT_OK(journal->catch_up(*store));
  EXPECT_EQ(store->audit()->head, direct->audit()->head) << "stored once";
}

TEST_F(SaveTest, ADamagedEarlierEntryBlocksTheStoreButLosesNoRun) {
  auto away = refused(ErrorCode::device_unavailable);
  ASSERT_OK(keep_on(away, 1));
  const std::string first = "journal/" + memory_.files.list("journal")->front();
  const Bytes whole = read_file(memory_.files, first).value();
  ASSERT_OK(memory_.files.remove(first));
  ASSERT_OK((*memory_.files.create(first))->write_at(0, std::span(whole).first(whole.size() / 2)));
  auto store = open("main");
  const auto kept = keep_on(store, 2);
  ASSERT_OK(kept);
  EXPECT_EQ(kept->folder, "journal");
  EXPECT_EQ(kept->refusal->code, ErrorCode::bad_data);
  EXPECT_THAT(kept->refusal->brief(), HasSubstr(first));
  EXPECT_EQ(pending("journal"), 6U);
  EXPECT_EQ(store->audit()->rows, 0);
  // Put back as it was, it goes into the store before all that came after it.
  ASSERT_OK(memory_.files.remove(first));
  ASSERT_OK((*memory_.files.create(first))->write_at(0, whole));
  const auto third = keep_on(store, 3);
  ASSERT_OK(third);
  EXPECT_EQ(third->caught_up, 6U);
  EXPECT_EQ(store->history("MOS2A1")->size(), 3U);
}

// A disk on which one folder cannot be written.
class OneBadFolder final : public sixpoint::ForwardingFiles {
 public:
  OneBadFolder(FileSystem& files, std::string bad) : ForwardingFiles(files), bad_(std::move(bad)) {}
  Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
    if (path.starts_with(bad_)) {
      return fail(ErrorCode::io, "no space left on the device", path, "free some space");
    }
    return ForwardingFiles::create(path);
  }

 private:
  std::string bad_;
};

TEST_F(SaveTest, WhereTheJournalsDiskFailsAnotherFolderTakesItAndIsNamed) {
  OneBadFolder files(memory_.files, "journal");
  auto away = refused(ErrorCode::permission);
  const auto kept = save(files, away, places_, work(1));
  ASSERT_OK(kept);
  EXPECT_TRUE(kept->last_resort);
  EXPECT_EQ(kept->folder, "last");
  EXPECT_THAT(kept->refusal->what, HasSubstr("no space left"));
  auto store = open("main");
  auto journal = Journal::open(memory_.files, "last");
  EXPECT_EQ(journal->catch_up(*store).value(), 3U);
}

TEST_F(SaveTest, WhereNoDiskTakesItBothReasonsAreSaid) {
  auto away = refused(ErrorCode::permission);
  memory_.files.fail_after(0);
  const auto kept = keep_on(away, 1);
  EXPECT_FAILS(kept, ErrorCode::io);
  EXPECT_THAT(kept.error().brief(), HasSubstr("there: no"));
}

TEST_F(SaveTest, ARecordThatNoStoreTakesIsRefusedAsSuch) {
  auto store = open("main");
  const auto kept = save(memory_.files, store, places_, [](RecordWriter& writer) -> Status {
    SIXPOINT_CHECK(writer.add_constants(ConstantsRecord{}, "w"));
    return {};
  });
  EXPECT_FAILS(kept, ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::db
