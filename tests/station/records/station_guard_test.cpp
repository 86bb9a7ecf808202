#include "station/records/station_guard.h"

#include <fstream>

#include <gmock/gmock.h>

#include "station/records/made_station.h"
#include "station/records/run_records.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

class StationGuards : public tests::StationRecords {
 protected:
  StationGuards() : guard_(env_.env, folder_ / "memory", default_limits()) {}
  Result<RetestState> ask(const std::string& serial, const std::string& name = "A") {
    Result<db::Store> open = db::Store::open(env_.env, folder_ / "s.db");
    return guard_.may_start(open, serial, name);
  }
  Result<RetestState> ask_without_store(const std::string& serial, const std::string& name = "A") {
    Result<db::Store> away = fail(ErrorCode::io, "the server does not answer");
    return guard_.may_start(away, serial, name);
  }
  void lock() {
    decide("check_unit", "CHECK1");
    baseline();
    add_run("CHECK1", JigVerdict::pass, 200);
  }
  StationGuard guard_;
};

TEST_F(StationGuards, WhereNothingIsToBeRememberedNothingIsWritten) {
  EXPECT_OK(ask("MOS2A1"));
  EXPECT_OK(guard_.note_verdict("MOS2A1", JigVerdict::pass, "jig"));
  EXPECT_FALSE(posix_env().files.info(folder_ / "memory"));
  EXPECT_OK(ask_without_store("MOS2A1"));
}

TEST_F(StationGuards, TheLockHoldsWhileTheStoreIsAway) {
  lock();
  EXPECT_FAILS(ask("MOS2A1"), ErrorCode::configuration);
  const auto held = ask_without_store("MOS2A1");
  EXPECT_FAILS(held, ErrorCode::configuration);
  EXPECT_THAT(held.error().what, HasSubstr("the store does not answer now"));
  EXPECT_THAT(held.error().hint, HasSubstr("--station 'A'"));
  EXPECT_OK(ask_without_store("CHECK1"));
  decide("sign");
  EXPECT_OK(ask("MOS2A1"));
  EXPECT_OK(ask_without_store("MOS2A1"));
}

TEST_F(StationGuards, TheLockHoldsUnderEveryName) {
  decide("check_unit", "CHECK1");
  EXPECT_OK(ask("MOS2A1", "A"));
  baseline();
  add_run("CHECK1", JigVerdict::pass, 200);
  for (const char* name : {"A", "", "a", "bench A"}) {
    SCOPED_TRACE(name);
    EXPECT_FAILS(ask("MOS2A1", name), ErrorCode::configuration);
    EXPECT_FAILS(ask_without_store("MOS2A1", name), ErrorCode::configuration);
  }
  EXPECT_EQ(guard_.memory()->names.size(), 4U);
  const std::string id = guard_.memory()->id;
  EXPECT_EQ(id.size(), 16U);
  EXPECT_OK(StationGuard(env_.env, folder_ / "other station", default_limits())
                .may_start(*std::make_unique<Result<db::Store>>(
                               db::Store::open(env_.env, folder_ / "s.db")),
                           "MOS2A1", "B"))
      << "another station is not concerned";
  decide("sign");
  EXPECT_OK(ask("MOS2A1", "a"));
  EXPECT_EQ(guard_.memory()->id, id) << "made once";
}

TEST_F(StationGuards, TheLimitOnFailuresHoldsWhileTheStoreIsAway) {
  add_run("MOS2A1", JigVerdict::fail);
  EXPECT_OK(ask("MOS2A1"));
  for (int failures = 2; failures <= default_limits().retest.most_failures; ++failures) {
    EXPECT_OK(ask_without_store("MOS2A1"));
    ASSERT_OK(guard_.note_verdict("MOS2A1", JigVerdict::fail, "jig"));
  }
  const auto refused = ask_without_store("MOS2A1");
  EXPECT_FAILS(refused, ErrorCode::configuration);
  EXPECT_THAT(refused.error().hint, HasSubstr("retest MOS2A1 --release"));
  EXPECT_OK(ask_without_store("MOS2A2"));
  // Passes that are needed after a failure count down.
  ASSERT_OK(guard_.note_verdict("MOS2A3", JigVerdict::fail, "jig"));
  EXPECT_EQ(ask_without_store("MOS2A3")->passes_needed, 2);
  // A write after the run, and a gage study, are no second run.
  ASSERT_OK(guard_.note_verdict("MOS2A3", JigVerdict::pass, kWriteKind));
  ASSERT_OK(guard_.note_verdict("MOS2A3", JigVerdict::fail, kStudyKind));
  EXPECT_EQ(ask_without_store("MOS2A3")->passes_needed, 2);
  ASSERT_OK(guard_.note_verdict("MOS2A3", JigVerdict::pass, "jig"));
  EXPECT_EQ(ask_without_store("MOS2A3")->passes_needed, 1);
  ASSERT_OK(guard_.note_verdict("MOS2A3", JigVerdict::pass, "jig"));
  EXPECT_FALSE(guard_.memory()->units.contains("MOS2A3"));
}

TEST_F(StationGuards, AMemoryThatCannotBeReadOpensNothing) {
  lock();
  EXPECT_FAILS(ask("MOS2A1"), ErrorCode::configuration);
  for (const char* text : {"", "{}", "[]", R"({"id": 7})"}) {
    std::ofstream(folder_ / "memory/memory.json") << text;
    EXPECT_FAILS(ask_without_store("MOS2A1"), ErrorCode::configuration);
    const auto held = ask("MOS2A1");
    EXPECT_FAILS(held, ErrorCode::configuration);
    EXPECT_THAT(held.error().hint, HasSubstr("removes this file"));
  }
}

}  // namespace
}  // namespace sixpoint::station
