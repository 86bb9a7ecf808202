// Jig runs in a lane: they survive a replug and a restart of the program, and are stored.
#include <algorithm>

#include "base/forwarding_files.h"
#include "base/sha256.h"
#include "station/lanes/run_folder.h"
#include "station/page/station_in_process.h"
#include "station/records/run_records.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

TEST(LaneRun, MeasuresAUnitAndStoresTheRunWithItsSamples) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.start("/api/run", {{"lane", 1}, {"operator", "Ada"}});
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane.dump(1);
  EXPECT_EQ(lane["result"]["run"], "abc123");
  EXPECT_EQ(lane["result"]["documents"], Json({"report.json"}));
  const Json quantities = lane["result"]["quantities"];
  ASSERT_GT(quantities.size(), 10U);
  EXPECT_EQ(lane["result"]["coverage_factor"], 2) << "of their expanded uncertainty";
  EXPECT_EQ(quantities[0]["title"], find_quantity(quantities[0]["name"].get<std::string>())->title);
  EXPECT_EQ(lane["run"]["taken"].size(), 14U);
  ASSERT_EQ(station.reports.size(), 1U);
  EXPECT_EQ(station.operators.front(), "Ada");
  EXPECT_THAT(station.reports.front().raw_csv, testing::StartsWith("device_time_us,"));
  EXPECT_EQ(station.reports.front().verification.poses.size(), 8U);
}

// The constants of a run that passed go into the unit later, without fourteen new placements; no
// statistics count it as a second run.
TEST(LaneRun, ARunThatPassedIsWrittenAfterwards) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,jig=auto"}, folder.path());
  station.wait_state(1, "idle");
  const Json now = {{"last_run", true}};
  EXPECT_EQ(station.post("/api/run", now), 409) << "nothing was measured";
  station.start("/api/run", {{"operator", "Ada"}});
  const auto stored = [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  };
  const Json measured = station.wait(1, stored);
  EXPECT_EQ(measured["result"]["written"], false);
  EXPECT_EQ(measured["result"]["can_write"], true);
  EXPECT_EQ(station.post("/api/run", {{"last_run", true}, {"operator", "Bo"}}), 202);
  const Json written = station.wait(
      1, [&](const Json& json) { return stored(json) && json["result"]["written"] == true; });
  EXPECT_EQ(written["result"]["verdict"], "pass") << written.dump(1);
  EXPECT_FALSE(written["result"].contains("can_write"));
  ASSERT_EQ(station.reports.size(), 2U);
  EXPECT_EQ(station.kinds, (std::vector<std::string>{"jig", kWriteKind}));
  EXPECT_EQ(station.operators.back(), "Ada, then Bo") << "Ada measured, Bo wrote";
  EXPECT_EQ(station.asked_to_write, std::vector<std::string>{"MOS2A45130007 def456"});
  const JigReport& first = station.reports.front();
  const JigReport& second = station.reports.back();
  EXPECT_EQ(second.recheck.poses.size(), 2U) << "measured again with what the unit holds";
  ASSERT_TRUE(second.as_left);
  EXPECT_EQ(second.as_left->constants, first.six->best().stored);
  EXPECT_EQ(second.started, first.started);
  EXPECT_GT(second.raw_csv.size(), first.raw_csv.size()) << "the samples of both";
  EXPECT_TRUE(second.raw_csv.starts_with(first.raw_csv));
  EXPECT_EQ(station.post("/api/run", now), 409) << "once";

  // In the store: one set of constants, which can be withdrawn, and one write.
  auto store = db::Store::open(posix_env(), folder / "records.db");
  ASSERT_OK(store);
  for (const auto& [report, kind] : {std::pair(first, "jig"), {second, kWriteKind}}) {
    db::RunRecord run = run_record_before({}, "MOS2A45130007", "J1");
    run.kind = kind;
    complete_run_record(run, report);
    const auto ids = add_run_records(*store, report, run);
    ASSERT_OK(ids);
    EXPECT_EQ(ids->constants_id.has_value(), run.kind == "jig");
  }
  const auto history = store->unit_history("MOS2A45130007");
  ASSERT_OK(history);
  EXPECT_EQ(history->constants.size(), 1U);
  EXPECT_EQ(history->writes.size(), 1U);
}

// The second pass after a fail would do; the write is none.
TEST(LaneRun, AConditionalPassStaysOneWhenItIsWrittenAfterwards) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,jig=auto"}, folder.path());
  const auto stored = [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  };
  station.retest = {1, 2, true, "the run that failed", {}};
  station.start("/api/run");
  const Json measured = station.wait(1, stored);
  ASSERT_EQ(measured["result"]["verdict"], "conditional_pass") << measured.dump(1);
  {
    const std::lock_guard lock(station.start_mutex);
    station.retest = {
        0, 1, true, "the run that passed", {}};  // what a run after this one would see
  }
  ASSERT_EQ(station.post("/api/run", {{"last_run", true}}), 202);
  const Json written = station.wait(
      1, [&](const Json& json) { return stored(json) && json["result"]["written"] == true; });
  EXPECT_EQ(written["result"]["verdict"], "conditional_pass") << written.dump(1);
  EXPECT_EQ(station.reports.back().codes, std::vector<std::string>{"retest"});
}

TEST(LaneRun, ConstantsThatWereWithdrawnAreNotWrittenAfterwards) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,jig=auto"}, folder.path());
  station.start("/api/run");
  station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  {
    const std::lock_guard lock(station.start_mutex);
    station.is_withdrawn = true;
  }
  ASSERT_EQ(station.post("/api/run", {{"last_run", true}}), 202);
  const Json refused = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["verdict"] == "refused";
  });
  EXPECT_THAT(refused["result"]["reasons"].dump(), HasSubstr("were withdrawn"));
  EXPECT_EQ(station.reports.size(), 1U);
  EXPECT_EQ(station.post("/api/run", {{"last_run", true}}), 409) << "measured again first";
}

// It is no second run either where the program ended in between: the next one goes on with a write.
TEST(LaneRun, AWriteAfterwardsStaysOneAfterARestart) {
  const std::string device = "virtual:seed=7,serial=MOS2A45130007,pace=50";
  const auto stored = [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  };
  for (const bool comes_back : {true, false}) {
    const tests::TemporaryFolder folder;
    const auto bench = std::make_shared<mocks::VirtualBench>();
    {
      Station station({device}, folder.path(), 24, bench);
      station.start("/api/run");
      place_unit(station, 1, 40);
      station.wait(1, stored);
      ASSERT_EQ(station.post("/api/run", {{"last_run", true}}), 202);
      station.wait(1, [](const Json& json) {
        return json["run"].is_object() && json["run"]["phase"] == "rechecking";
      });
    }
    Station station({device}, folder.path(), 24, bench);
    station.wait_state(1, "running");
    if (comes_back) {
      place_unit(station, 1, 40);
    } else {
      ASSERT_EQ(station.post("/api/lanes/1/hand", {{"do", "unplug"}}), 200);
      station.wait_state(1, "unit_away");
      ASSERT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
    }
    const Json done = station.wait(1, stored);
    EXPECT_EQ(station.kinds, std::vector<std::string>{kWriteKind}) << done.dump(1);
    EXPECT_TRUE(station.asked_to_write.empty()) << "they are in the unit already";
    if (comes_back) {
      EXPECT_EQ(done["result"]["verdict"], "pass") << done.dump(1);
      EXPECT_THAT(done["result"]["reasons"].dump(), HasSubstr("written after the run"));
    }
  }
}

// What was measured on one unit is never written into another one.
TEST(LaneRun, ConstantsOfTheLastRunAreForItsOwnUnitAlone) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,jig=auto"}, folder.path());
  station.start("/api/run");
  station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  ASSERT_EQ(station.post("/api/lanes/1/hand", {{"do", "swap"}, {"serial", "MOS2A45139999"}}), 200);
  station.wait(1, [](const Json& json) {
    return json["unit"].is_object() && json["unit"]["serial"] == "MOS2A45139999";
  });
  EXPECT_EQ(station.post("/api/run", {{"last_run", true}}), 409);
  EXPECT_EQ(station.reports.size(), 1U);
}

// "Stored" is said only when it is.
TEST(LaneRun, ARunThatTheJournalKeepsIsNotCalledStored) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.is_kept_here = true;
  station.start("/api/run");
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"].contains("run");
  });
  EXPECT_EQ(lane["result"]["stored"], false);
  EXPECT_EQ(lane["result"]["kept_here"], true);
}

// The journal may have gone into the store since, and there an engineer may have withdrawn them.
TEST(LaneRun, ConstantsThatTheJournalKeepsAreAskedAboutBeforeTheyAreWritten) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,jig=auto"}, folder.path());
  station.is_kept_here = true;
  station.is_withdrawn = true;
  station.start("/api/run");
  station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"].contains("run");
  });
  ASSERT_EQ(station.post("/api/run", {{"last_run", true}}), 202);
  station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["verdict"] == "refused";
  });
  EXPECT_EQ(station.asked_to_write, std::vector<std::string>{"MOS2A45130007 def456"});
}

// The station is locked after the run, and opened again.
TEST(LaneRun, ConstantsWaitOnWhereTheStationRefusesToWriteThem) {
  struct Refused {
    const char* path;
    Json body;
  };
  const std::vector<Refused> cases = {{"/api/run", {{"last_run", true}}},
                                      {"/api/run", Json::object()},
                                      {"/api/capture", Json::object()}};
  for (const auto& [path, body] : cases) {
    SCOPED_TRACE(path + body.dump());
    const tests::TemporaryFolder folder;
    Station station({"virtual:seed=7,serial=MOS2A45130007,jig=auto"}, folder.path());
    const auto refuse = [&](bool refused) {
      const std::lock_guard lock(station.start_mutex);
      station.starts_refused = refused;
    };
    const auto stored = [](const Json& json) {
      return json["result"].is_object() && json["result"]["stored"] == true;
    };
    station.start("/api/run");
    station.wait(1, stored);
    refuse(true);
    ASSERT_EQ(station.post(path, body), 202);
    const Json refused = station.wait(1, [](const Json& json) {
      return json["result"].is_object() && json["result"]["verdict"] == "refused";
    });
    EXPECT_EQ(refused["result"].value("can_write", false), true) << "from the first moment on";
    refuse(false);
    ASSERT_EQ(station.post("/api/run", {{"last_run", true}}), 202);
    station.wait(
        1, [&](const Json& json) { return stored(json) && json["result"]["written"] == true; });
    ASSERT_EQ(station.reports.size(), 2U);
    const std::string& first = station.reports.front().raw_csv;
    const std::string& second = station.reports.back().raw_csv;
    EXPECT_TRUE(second.starts_with(first));
    EXPECT_EQ(second.find(first.substr(0, 1000), 1), std::string::npos) << "its samples once";
  }
}

// What began after the run that passed, or was plugged in, ends the wait: also where a start is
// refused then.
TEST(LaneRun, NoRefusedStartBringsBackConstantsOfAnEarlierRun) {
  for (const std::string between : {"/api/run", "/api/capture", "another unit"}) {
    SCOPED_TRACE(between);
    const tests::TemporaryFolder folder;
    Station station({"virtual:seed=7,serial=MOS2A45130007,pace=100"}, folder.path());
    station.start("/api/run");
    place_unit(station, 1, 40);
    const Json passed = station.wait(1, [](const Json& json) {
      return json["result"].is_object() && json["result"]["stored"] == true;
    });
    ASSERT_EQ(passed["result"]["can_write"], true);
    const auto verdict = [&](const std::string& expected) {
      return station.wait(1, [&](const Json& json) {
        return json["result"].is_object() && json["result"]["verdict"] == expected;
      });
    };
    if (between == "another unit") {
      for (const char* serial : {"MOS2A45139999", "MOS2A45130007"}) {
        ASSERT_EQ(station.post("/api/lanes/1/hand", {{"do", "swap"}, {"serial", serial}}), 200);
        station.wait(1, [&](const Json& json) {
          return json["unit"].is_object() && json["unit"]["serial"] == serial;
        });
      }
    } else {
      ASSERT_EQ(station.post(between, Json::object()), 202);
      station.wait(1, [](const Json& json) { return json["result"].is_null(); });
      ASSERT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
      verdict("stopped");
    }
    {
      const std::lock_guard lock(station.start_mutex);
      station.starts_refused = true;
    }
    ASSERT_EQ(station.post("/api/run", Json::object()), 202);
    EXPECT_FALSE(verdict("refused")["result"].contains("can_write"));
    EXPECT_EQ(station.post("/api/run", {{"last_run", true}}), 409);
    EXPECT_TRUE(station.asked_to_write.empty());
  }
}

// The disk of the store is not mounted, its server does not answer, or it is of a later version.
TEST(LaneRun, ConstantsWaitOnWhereTheStoreDoesNotAnswerWhateverItsError) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,jig=auto"}, folder.path());
  const auto set_answer = [&](const std::optional<Error>& error) {
    const std::lock_guard lock(station.start_mutex);
    station.no_answer = error;
  };
  station.start("/api/run");
  station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  for (const ErrorCode code :
       {ErrorCode::no_input, ErrorCode::configuration, ErrorCode::device_unavailable}) {
    const std::string what = fmt::format("no answer {}", static_cast<int>(code));
    set_answer(Error{code, what, {}, {}});
    ASSERT_EQ(station.post("/api/run", {{"last_run", true}}), 202);
    const Json refused = station.wait(1, [&](const Json& json) {
      return json["result"].is_object() &&
             json["result"]["reasons"].dump().find(what) != std::string::npos;
    });
    EXPECT_EQ(refused["result"]["verdict"], "refused");
    EXPECT_EQ(refused["result"].value("can_write", false), true);
  }
  set_answer({});
  ASSERT_EQ(station.post("/api/run", {{"last_run", true}}), 202);
  const Json written = station.wait(1, [&](const Json& json) {
    return json["result"].is_object() && json["result"].value("written", false);
  });
  EXPECT_EQ(written["result"]["verdict"], "pass") << written.dump(1);
}

// The program ended between the order to write and the write; meanwhile they were withdrawn.
TEST(LaneRun, AWriteThatGoesOnIsAskedAgainWhetherItsConstantsWereWithdrawn) {
  for (const std::string id : {"def456", ""}) {  // without: of an earlier version
    const tests::TemporaryFolder folder;
    const std::string device = "virtual:seed=7,serial=MOS2A45130007,jig=auto";
    UnfinishedRun left;
    left.device = device;
    left.serial = "MOS2A45130007";
    left.station = "bench-1";
    left.jig = "virtual";
    left.kind = kWriteKind;
    left.constants_id = id;
    left.write = true;
    left.resume.started = *parse_iso8601("2026-01-02T03:04:05");
    ASSERT_OK(
        RunFolder(posix_env(), folder.path() + "/state/lane-1-" + text_sha256(device).substr(0, 8))
            .save(left));
    Station station({device}, folder.path(), 24, {}, {}, false,
                    /*its_constants_are_withdrawn=*/true);
    const Json lane = station.wait(1, [](const Json& json) {
      return json["result"].is_object() && json["result"]["stored"] == true;
    });
    EXPECT_THAT(lane["result"]["reasons"].dump(), HasSubstr("these constants were withdrawn"));
    EXPECT_EQ(lane["result"]["verdict"], "inconclusive");
    EXPECT_EQ(lane["result"]["written"], false);
    EXPECT_EQ(station.asked_to_write, std::vector<std::string>{"MOS2A45130007 " + id});
    EXPECT_EQ(station.kinds, std::vector<std::string>{kWriteKind});
  }
}

// Ended on the last day of the jig, and begun again days later.
TEST(LaneRun, ARunThatGoesOnIsAskedAgainWhetherItMayStart) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,serial=MOS2A45130007,jig=auto";
  UnfinishedRun left;
  left.device = device;
  left.serial = "MOS2A45130007";
  left.station = "bench-1";
  left.jig = "virtual";
  left.resume.started = *parse_iso8601("2026-01-02T03:04:05");
  ASSERT_OK(
      RunFolder(posix_env(), folder.path() + "/state/lane-1-" + text_sha256(device).substr(0, 8))
          .save(left));
  Station station({device}, folder.path(), 24, {}, {}, /*refuses_starts=*/true);
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  EXPECT_THAT(lane["result"]["reasons"].dump(), HasSubstr("the jig is overdue; sign"));
  const std::lock_guard lock(station.mutex);
  ASSERT_EQ(station.reports.size(), 1U);
  EXPECT_EQ(station.reports.front().verdict, JigVerdict::inconclusive);
  EXPECT_EQ(station.reports.front().jig, "virtual");
}

TEST(LaneRun, AsksForEachPlacementAndRefusesWrongOnesWithTheReason) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=50"}, folder.path());
  station.start("/api/run", {{"operator", "Ada"}});
  const auto hand = [&](const Json& body) { return station.post("/api/lanes/1/hand", body); };
  const auto refusal_of = [&](const std::string& text) {
    station.wait(1, [&](const Json& json) {
      return json["run"].is_object() &&
             json["run"]["last_refusal"].get<std::string>().find(text) != std::string::npos;
    });
  };
  place_unit(station, 1, 3);
  station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 3; });
  EXPECT_EQ(hand({{"do", "turn"}, {"pose", "+z"}}), 200);
  refusal_of("+z is done already");
  EXPECT_EQ(hand({{"do", "lean"}}), 200);
  refusal_of("lies on none of its six faces");
  EXPECT_EQ(hand({{"do", "turn"}, {"pose", "-x"}, {"tilt_deg", 7.2}}), 200);
  refusal_of("tilted");
  // Undo, and the pose is wanted again.
  EXPECT_EQ(station.post("/api/lanes/1/undo", Json::object()), 200);
  station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 2; });
  place_unit(station, 1, 40);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["result"]["verdict"], "pass") << lane.dump(1);
}

TEST(LaneRun, ContinuesAfterAReplugAndNoticesAnotherUnit) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,pace=50"}, folder.path());
  station.start("/api/run");
  place_unit(station, 1, 4);
  station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 4; });
  const auto hand = [&](const Json& body) { return station.post("/api/lanes/1/hand", body); };
  hand({{"do", "unplug"}});
  const auto before = std::chrono::steady_clock::now();
  station.wait_state(1, "unit_away");
  EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::seconds(5));
  hand({{"do", "plug"}});
  station.wait_state(1, "running");
  EXPECT_EQ(station.lane(1)["run"]["taken"].size(), 4U) << "nothing is lost";
  // Another unit in its place: nothing of it gets into the run.
  expect_swap_is_noticed(station);
}

TEST(LaneRun, ARunSurvivesTheProgram) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,pace=50";
  std::size_t rows = 0;
  {
    Station station({device}, folder.path());
    station.start("/api/run", {{"operator", "Ada"}});
    place_unit(station, 1, 7);
    station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 7; });
    EXPECT_TRUE(station.reports.empty());
  }
  {
    Station station({device}, folder.path());
    const Json lane = station.wait_state(1, "running");
    EXPECT_EQ(lane["operator"], "Ada");
    station.wait(1, [](const Json& json) {
      return json["run"].is_object() && json["run"]["taken"].size() == 7;
    });
    place_unit(station, 1, 20);
    const Json done = station.wait(1, [](const Json& json) {
      return json["result"].is_object() && json["result"]["stored"] == true;
    });
    EXPECT_EQ(done["result"]["verdict"], "pass") << done.dump(1);
    ASSERT_EQ(station.reports.size(), 1U);
    const std::string& raw = station.reports.front().raw_csv;
    rows = static_cast<std::size_t>(std::count(raw.begin(), raw.end(), '\n'));
    EXPECT_GT(rows, 14U * 600U) << "the samples of both programs";
    EXPECT_EQ(raw.find("device_time_us", 1), std::string::npos) << "one headline";
  }
  Station station({device}, folder.path());
  station.wait_state(1, "idle");  // nothing is left to go on with
}

TEST(LaneRun, AnInterruptedRunWithoutItsUnitEndsWithItsData) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,pace=50";
  {
    Station station({device}, folder.path());
    station.start("/api/run");
    place_unit(station, 1, 2);
    station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 2; });
    station.post("/api/lanes/1/hand", {{"do", "unplug"}});
    station.wait_state(1, "unit_away");
  }
  // The same lane, another unit at its address.
  Station station({device}, folder.path());
  station.wait_state(1, "running");
  station.post("/api/lanes/1/hand", {{"do", "unplug"}});
  station.wait_state(1, "unit_away");
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
  station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  ASSERT_EQ(station.reports.size(), 1U);
  EXPECT_EQ(station.reports.front().faces.size(), 2U);
  EXPECT_GT(station.reports.front().raw_csv.size(), 20'000U);
}

// The program was killed in mid-write, and the unit never comes back: no one knows what it holds.
TEST(LaneRun, AWriteThatWasBegunByAKilledProgramLeavesTheUnitUnknown) {
  for (const bool begun : {false, true}) {
    const tests::TemporaryFolder folder;
    const std::string device = "virtual:seed=7,serial=MOS2A45130007,pace=50";
    UnfinishedRun left;
    left.device = device;
    left.serial = "MOS2A45139999";  // another unit than the one in the lane now
    left.station = "bench-1";
    left.client = "me";
    left.write = true;
    left.kind = begun ? kWriteKind : "jig";
    left.resume.started = *parse_iso8601("2026-01-02T03:04:05");
    left.resume.as_found = device::CalibrationPage{};
    left.resume.write_begun = begun;
    ASSERT_OK(
        RunFolder(posix_env(), folder.path() + "/state/lane-1-" + text_sha256(device).substr(0, 8))
            .save(left));
    Station station({device}, folder.path());
    station.wait_state(1, "wrong_unit");
    EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
    station.wait(1, [](const Json& json) {
      return json["result"].is_object() && json["result"]["stored"] == true;
    });
    ASSERT_EQ(station.reports.size(), 1U);
    EXPECT_EQ(station.kinds.front(), left.kind);
    EXPECT_EQ(station.reports.front().as_left.has_value(), !begun);
    EXPECT_EQ(station.reports.front().verdict, JigVerdict::stopped);
  }
}

// The station was ended in mid-run and begins again on another jig (a tester's finding: the record
// named the second one alone).
TEST(LaneRun, ARunDoesNotGoOnOnAnotherJig) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,serial=MOS2A45130007,jig=auto";
  UnfinishedRun left;
  left.device = device;
  left.serial = "MOS2A45130007";
  left.operator_name = "Ada";
  left.station = "bench-1";
  left.jig_id = "J-1";
  left.resume.started = *parse_iso8601("2026-01-02T03:04:05");
  ASSERT_OK(
      RunFolder(posix_env(), folder.path() + "/state/lane-1-" + text_sha256(device).substr(0, 8))
          .save(left));
  Station station({device}, folder.path());
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  EXPECT_THAT(lane["result"].dump(), testing::HasSubstr("begun on jig 'J-1', and this is ''"));
  const std::lock_guard lock(station.mutex);
  ASSERT_EQ(station.reports.size(), 1U);
  EXPECT_EQ(station.reports.front().verdict, JigVerdict::inconclusive);
  EXPECT_EQ(station.operators.front(), "Ada");
  EXPECT_EQ(station.jigs.front(), "J-1");
}

TEST(LaneRun, AStoreThatFailsIsTriedAgain) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.store_is_away = true;
  station.start("/api/run");
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"].contains("problem");
  });
  EXPECT_EQ(lane["result"]["verdict"], "pass");
  EXPECT_EQ(lane["result"]["stored"], false);
  EXPECT_EQ(station.post("/api/run", Json::object()), 409)
      << "it would take the place of the first";
  {
    const std::lock_guard lock(station.mutex);
    station.store_is_away = false;
  }
  station.wait(1, [](const Json& json) { return json["result"]["stored"] == true; });
  EXPECT_EQ(station.reports.size(), 1U);
}

TEST(LaneRun, ThatOtherConstantsApplyIsSaid) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.said = "stored, but others apply";
  station.start("/api/run");
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  ASSERT_FALSE(lane["log"].empty());
  EXPECT_EQ(lane["log"].back()["kind"], "problem") << "the page shows the last one";
  EXPECT_EQ(lane["log"].back()["text"], "stored, but others apply");
}

// To try again would help nothing, and no second run could be made.
TEST(LaneRun, ARunThatNoStoreTakesIsKeptInAFileAndTheLaneIsFree) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.store_refuses = true;
  station.start("/api/run");
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"].contains("problem");
  });
  EXPECT_EQ(lane["result"]["stored"], false);
  EXPECT_FALSE(lane["result"].contains("can_write"));
  const std::string problem = lane["result"]["problem"];
  EXPECT_THAT(problem, HasSubstr("cannot be stored as a text"));
  const std::string before = "it is kept in ";
  const std::size_t begin = problem.find(before) + before.size();
  const std::string path = problem.substr(begin, problem.find(", its samples") - begin);
  const auto report = read_file(posix_env().files, path, 10'000'000);
  ASSERT_OK(report);
  EXPECT_EQ(Json::parse(*report)["verdict"], "pass");
  const auto names = posix_env().files.list(folder_of(path));
  ASSERT_OK(names);
  EXPECT_THAT(*names, testing::Contains(testing::MatchesRegex("samples-1.csv.*bad")));
  EXPECT_THAT(*names, testing::Not(testing::Contains("run.json"))) << "a later program is free too";
  {
    const std::lock_guard lock(station.mutex);
    station.store_refuses = false;
  }
  EXPECT_EQ(station.post("/api/run", {{"last_run", true}}), 409) << "there is no record of it";
  EXPECT_EQ(station.post("/api/run", Json::object()), 202);
  station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
}

// The lane's thread is held in the store while "write now" is given.
TEST(LaneRun, AWriteThatWasOrderedBeforeItsRunWasSetAsideIsNotCarriedOut) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,jig=auto"}, folder.path());
  {
    const std::unique_lock held(station.mutex);
    station.store_refuses = true;
    station.start("/api/run");
    station.wait(1, [](const Json& json) {
      return json["result"].is_object() && json["result"].value("can_write", false);
    });
    ASSERT_EQ(station.post("/api/run", {{"last_run", true}}), 202);
  }
  const Json lane = station.wait(1, [](const Json& json) {
    return json["log"].dump().find("not started: there is no record") != std::string::npos;
  });
  EXPECT_EQ(lane["state"], "done");
  EXPECT_EQ(lane["result"]["written"], false) << lane["result"].dump(1);
  EXPECT_EQ(station.post("/api/run", {{"last_run", true}}), 409);
}

// A defect ends the work of its lane, with a word, and not the program with all the others.
TEST(LaneRun, AnExceptionEndsTheWorkOfItsLaneAlone) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,jig=auto",
                   "virtual:seed=8,serial=MOS2A45130008,jig=auto"},
                  folder.path());
  station.wait_state(2, "idle");
  EXPECT_EQ(station.post("/api/run", {{"lane", 2}}), 202);
  // Its start is behind it: the defect is the other lane's alone.
  station.wait(2, [](const Json& json) {
    return json["result"].is_object() || (json["run"].is_object() && !json["run"]["taken"].empty());
  });
  station.start_has_defect = true;
  station.start("/api/run");
  const Json failed = station.wait_state(1, "done");
  EXPECT_EQ(failed["result"]["verdict"], "inconclusive");
  EXPECT_THAT(failed["result"]["reasons"].dump(), HasSubstr("no such key"));
  const auto stored = [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  };
  EXPECT_EQ(station.wait(2, stored)["result"]["verdict"], "pass");
}

TEST(LaneRun, AnExceptionOfTheStoreTakesNothingThatWasMeasured) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.has_defect = true;
  station.start("/api/run");
  const Json lane = station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"].contains("problem");
  });
  const std::string problem = lane["result"]["problem"];
  EXPECT_THAT(problem, HasSubstr("no such key"));
  EXPECT_THAT(problem, HasSubstr("it is kept in"));
  EXPECT_THAT(problem, HasSubstr("not known whether the store has the run"));
  EXPECT_THAT(problem, testing::Not(HasSubstr("no store takes it"))) << "it may have taken it";
}

class FilesWithoutNewNames final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Status rename(const std::string& from, const std::string& to) override {
    if (!fails || !from.ends_with("/run.json")) {
      return ForwardingFiles::rename(from, to);
    }
    ++attempts;
    return fail(ErrorCode::io, "the disk fails", to, "see to the disk");
  }
  std::atomic<bool> fails{true};
  std::atomic<int> attempts{0};
};

// The lane waits between two attempts. The number of attempts is bound by the time that went by.
TEST(LaneRun, ASetAsideThatFailsIsTriedAgainAfterAPause) {
  const tests::TemporaryFolder folder;
  FilesWithoutNewNames files(posix_env().files);
  Env env{posix_env().clock, files};
  mocks::VirtualBench bench;
  device::TransportRegistry registry = known_devices();
  bench.register_in(registry);
  LanesOptions options;
  options.devices = {"virtual:seed=7,jig=auto"};
  options.state_folder = folder / "state";
  std::atomic<int> asked{0};
  const auto lanes =
      Lanes::open(env, registry, options,
                  [&](const JigReport&, const RunLabels&) -> Result<RunInStore> {
                    ++asked;
                    return fail(ErrorCode::bad_data, "this cannot be stored as a text");
                  },
                  {});
  ASSERT_OK(lanes);
  const auto wait = [&](auto ready) {
    for (int i = 0; i < 3000 && !ready((*lanes)->to_json(1)); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return (*lanes)->to_json(1);
  };
  const auto problem_has = [](const std::string& text) {
    return [text](const Json& json) {
      return json["result"].is_object() &&
             json["result"].value("problem", "").find(text) != std::string::npos;
    };
  };
  wait([](const Json& json) { return json["state"] == "idle"; });
  ASSERT_TRUE((*lanes)->start(1, {}).has_value());
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_TRUE(problem_has("not set aside yet")(wait(problem_has("not set aside yet"))));
  EXPECT_FALSE((*lanes)->start(1, {}).has_value()) << "it would take the place of the first";
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  const int tried = files.attempts;
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
  EXPECT_LE(tried, 1 + passed.count() / 1.9) << "two seconds lie between two attempts";
  files.fails = false;
  EXPECT_TRUE(problem_has("it is kept in")(wait(problem_has("it is kept in"))));
  EXPECT_EQ(asked, 1) << "the store is not asked again";
}

}  // namespace
}  // namespace sixpoint::station
