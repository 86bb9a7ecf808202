#include "station/records/station_guard.h"

#include <atomic>
#include <fstream>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "base/forwarding_files.h"
#include "open_files_limit.h"
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
  // A run that ended just now and that the store does not have, or has.
  Status note(const std::string& serial, JigVerdict verdict, bool is_stored = false,
              const std::string& kind = "jig") {
    db::RunRecord run;
    run.id = fmt::format("{:064x}", ++noted_);
    run.serial = serial;
    run.kind = kind;
    run.verdict = to_string(verdict);
    run.ended = env_.clock.now();
    return guard_.note_run(run, is_stored);
  }
  void lock() {
    decide("check_unit", "CHECK1");
    baseline();
    add_run("CHECK1", JigVerdict::pass, 200);
  }
  StationGuard guard_;
  int noted_ = 0;
};

TEST_F(StationGuards, WhereNothingIsToBeRememberedNothingIsWritten) {
  EXPECT_OK(ask("MOS2A1"));
  EXPECT_OK(note("MOS2A1", JigVerdict::pass));
  EXPECT_FALSE(posix_env().files.info(folder_ / "memory/memory.json"));
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
    ASSERT_OK(note("MOS2A1", JigVerdict::fail));
  }
  const auto refused = ask_without_store("MOS2A1");
  EXPECT_FAILS(refused, ErrorCode::configuration);
  EXPECT_THAT(refused.error().hint, HasSubstr("retest MOS2A1 --release"));
  EXPECT_OK(ask_without_store("MOS2A2"));
  // Passes that are needed after a failure count down.
  ASSERT_OK(note("MOS2A3", JigVerdict::fail));
  EXPECT_EQ(ask_without_store("MOS2A3")->passes_needed, 2);
  // A write after the run, and a gage study, are no second run.
  ASSERT_OK(note("MOS2A3", JigVerdict::pass, false, kWriteKind));
  ASSERT_OK(note("MOS2A3", JigVerdict::fail, false, kStudyKind));
  EXPECT_EQ(ask_without_store("MOS2A3")->passes_needed, 2);
  ASSERT_OK(note("MOS2A3", JigVerdict::pass));
  EXPECT_EQ(ask_without_store("MOS2A3")->passes_needed, 1);
  ASSERT_OK(note("MOS2A3", JigVerdict::pass));
  EXPECT_FALSE(guard_.memory()->units.contains("MOS2A3"));
}

// A full disk: the store answers what it has, and takes nothing. A tester's four runs: the fourth
// passed.
// Two programs of one bench that end their runs at a time.
TEST_F(StationGuards, NoFailureIsForgottenWhereProgramsNoteThemAtOnce) {
  constexpr int kPrograms = 4;
  constexpr int kUnits = 6;
  std::vector<std::thread> programs;
  std::atomic<int> noted = 0;
  for (int program = 0; program < kPrograms; ++program) {
    programs.emplace_back([&, program] {
      StationGuard guard(posix_env(), folder_ / "memory", default_limits());
      for (int unit = 0; unit < kUnits; ++unit) {
        db::RunRecord run;
        run.serial = fmt::format("MOS2A{}{}", program, unit);
        run.kind = "jig";
        run.verdict = to_string(JigVerdict::fail);
        noted += guard.note_run(run, /*is_stored=*/false) ? 1 : 0;
      }
    });
  }
  for (std::thread& program : programs) {
    program.join();
  }
  EXPECT_EQ(noted, kPrograms * kUnits);
  EXPECT_EQ(guard_.memory()->units.size(), static_cast<std::size_t>(kPrograms * kUnits));
}

TEST_F(StationGuards, AGageStudyAsksForTheLockAlone) {
  for (int i = 0; i < 3; ++i) {
    ASSERT_OK(note("MOS2A1", JigVerdict::fail));
  }
  Result<db::Store> open = db::Store::open(env_.env, folder_ / "s.db");
  Result<db::Store> away = fail(ErrorCode::io, "the server does not answer");
  for (Result<db::Store>* store : {&open, &away}) {
    EXPECT_FAILS(guard_.may_start(*store, "MOS2A1", "A"), ErrorCode::configuration);
    const auto study = guard_.may_start(*store, "MOS2A1", "A", StartOf::study);
    ASSERT_OK(study);
    EXPECT_EQ(study->passes_needed, RetestState().passes_needed);
  }
  lock();
  for (Result<db::Store>* store : {&open, &away}) {
    EXPECT_FAILS(guard_.may_start(*store, "MOS2A2", "A", StartOf::study), ErrorCode::configuration);
    EXPECT_OK(guard_.may_start(*store, "CHECK1", "A", StartOf::study));
  }
}

TEST_F(StationGuards, RunsThatAStoreDoesNotTakeCountBesideThoseThatItHas) {
  add_run("MOS2A1", JigVerdict::fail);
  EXPECT_EQ(ask("MOS2A1")->failures_in_row, 1);
  ASSERT_OK(note("MOS2A1", JigVerdict::fail));
  EXPECT_EQ(ask("MOS2A1")->failures_in_row, 2);
  EXPECT_EQ(ask("MOS2A1")->passes_needed, 2);
  ASSERT_OK(note("MOS2A1", JigVerdict::fail));
  EXPECT_FAILS(ask("MOS2A1"), ErrorCode::configuration);
  EXPECT_EQ(guard_.unit_state(store_, "MOS2A1")->failures_in_row, 3);
  EXPECT_OK(ask("MOS2A2")) << "another unit is not concerned";
  // The release comes after them.
  decide("release", "MOS2A1");
  EXPECT_EQ(ask("MOS2A1")->failures_in_row, 0);
  EXPECT_EQ(ask("MOS2A1")->passes_needed, 2) << "released, and not yet passed";
  ASSERT_OK(note("MOS2A1", JigVerdict::pass));
  EXPECT_EQ(ask("MOS2A1")->passes_needed, 1);
  ASSERT_OK(note("MOS2A1", JigVerdict::pass));
  EXPECT_EQ(ask("MOS2A1")->passes_needed, 1);
  EXPECT_TRUE(ask("MOS2A1")->retest_of.empty()) << "it counts as passed";
}

TEST_F(StationGuards, ARunThatTheStoreTookLaterCountsOnce) {
  add_run("MOS2A1", JigVerdict::fail);
  db::RunRecord taken;
  ASSERT_OK(store_.for_each_run({}, [&](const db::RunRecord& run) -> Status {
    taken = run;
    return {};
  }));
  ASSERT_OK(guard_.note_run(taken, /*is_stored=*/false));
  EXPECT_EQ(ask("MOS2A1")->failures_in_row, 1);
  EXPECT_TRUE(guard_.memory()->waiting.empty());
  // A run that nothing took has no id: it counts until the unit counts as passed.
  taken.id.clear();
  ASSERT_OK(guard_.note_run(taken, /*is_stored=*/false));
  EXPECT_EQ(ask("MOS2A1")->failures_in_row, 2);
  add_run("MOS2A1", JigVerdict::pass);
  add_run("MOS2A1", JigVerdict::pass);
  EXPECT_EQ(ask("MOS2A1")->failures_in_row, 0);
  EXPECT_TRUE(guard_.memory()->waiting.empty());
}

TEST_F(StationGuards, AMemoryThatCannotBeReadOpensNothing) {
  lock();
  EXPECT_FAILS(ask("MOS2A1"), ErrorCode::configuration);
  for (const char* text : {"", "{}", "[]", R"({"id": 7})",
                           R"({"id": "a", "names": [], "locked": false, "locked_as": "", "why": "",
                               "check_units": [], "units": {}, "waiting": {"MOS2A1": [{}]}})"}) {
    std::ofstream(folder_ / "memory/memory.json") << text;
    EXPECT_FAILS(ask_without_store("MOS2A1"), ErrorCode::configuration);
    const auto held = ask("MOS2A1");
    EXPECT_FAILS(held, ErrorCode::configuration);
    EXPECT_THAT(held.error().hint, HasSubstr("removes this file"));
  }
}

// A disk that does not answer is no station without a memory, and its file is not to be removed.
TEST_F(StationGuards, AMemoryOnADiskThatFailsOpensNothing) {
  class FailingDisk final : public ForwardingFiles {
   public:
    using ForwardingFiles::ForwardingFiles;
    Result<FileInfo> info(const std::string& path) override {
      return fail(ErrorCode::io, "the disk does not answer", path, "check the disk");
    }
  } disk(posix_env().files);
  lock();
  EXPECT_FAILS(ask("MOS2A1"), ErrorCode::configuration);
  Env env{env_.env.clock, disk};
  Result<db::Store> away = fail(ErrorCode::io, "the server does not answer");
  EXPECT_FAILS(
      StationGuard(env, folder_ / "memory", default_limits()).may_start(away, "MOS2A1", "A"),
      ErrorCode::configuration);  // locked: what cannot be looked at is opened all the same
  const sixpoint::tests::OpenFilesLimit limit(0);
  EXPECT_FAILS(ask_without_store("MOS2A1"), ErrorCode::io);
}

}  // namespace
}  // namespace sixpoint::station
