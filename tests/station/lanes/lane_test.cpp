// Commands to one lane: who may give them, and when.
#include "station/lanes/order_rule.h"
#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

TEST(Lane, TwoOperatorsOnOneLane) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=20"}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/run", {{"operator", "Ada"}}, "page-a"), 202);
  EXPECT_EQ(station.post("/api/run", {{"operator", "Bob"}}, "page-b"), 409);
  station.wait_state(1, "running");
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object(), "page-b"), 409);
  EXPECT_EQ(station.post("/api/lanes/1/take", {{"operator", "Bob"}}, "page-b"), 200);
  EXPECT_EQ(station.post("/api/lanes/1/undo", Json::object(), "page-a"), 409);
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object(), "page-b"), 200);
  const Json lane = station.wait_state(1, "done");
  EXPECT_EQ(lane["operator"], "Bob");
  EXPECT_EQ(lane["result"]["verdict"], "stopped");
}

StartOrder order_of(const std::string& client) {
  StartOrder order;
  order.operator_name = "Ada";
  order.client = client;
  return order;
}

// Each row is a command that makes no sense now: a conflict that says what to do, and no change.
TEST(Lane, WhereNothingRunsThereIsNothingToCommand) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  station.wait_state(1, "idle");
  Lanes& lanes = *station.lanes;
  const auto expect_conflict = [](const LaneAnswer<void>& answer) {
    ASSERT_FALSE(answer.has_value());
    EXPECT_EQ(answer.error().kind, LaneRefusal::Kind::conflict);
    EXPECT_FALSE(answer.error().what.empty());
    EXPECT_FALSE(answer.error().hint.empty());
  };
  const std::uint64_t changes = lanes.changes(1);
  expect_conflict(lanes.command(1, "page-a", OperatorCommand::stop));
  expect_conflict(lanes.command(1, "page-a", OperatorCommand::undo));
  expect_conflict(lanes.confirm_side(1, "page-a"));
  expect_conflict(lanes.take_over(1, "page-a", "Ada"));
  EXPECT_EQ(lanes.state(1), LaneState::idle);
  EXPECT_EQ(lanes.changes(1), changes);
}

TEST(Lane, WithoutAUnitNothingStarts) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_EQ(station.post("/api/lanes/1/hand", {{"do", "unplug"}}), 200);
  station.wait_state(1, "absent");
  const auto refused = station.lanes->start(1, order_of("page-a"));
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().what, "no unit is plugged in here");
  EXPECT_FALSE(station.lanes->start_capture(1, order_of("page-a")).has_value());
  ASSERT_EQ(station.post("/api/lanes/1/hand", {{"do", "plug"}}), 200);
  station.wait_state(1, "idle");
  EXPECT_TRUE(station.lanes->start(1, order_of("page-a")).has_value());
  station.wait_state(1, "running");
}

TEST(Lane, OneRunAtATimeAndNoOtherLabelDuringIt) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007"}, folder.path());
  station.wait_state(1, "idle");
  Lanes& lanes = *station.lanes;
  ASSERT_TRUE(lanes.start(1, order_of("page-a")).has_value());
  const auto second = lanes.start(1, order_of("page-a"));
  ASSERT_FALSE(second.has_value()) << "also from the same page, also before the thread took it";
  EXPECT_THAT(second.error().what, testing::HasSubstr("Ada"));
  station.wait_state(1, "running");
  EXPECT_FALSE(lanes.start_capture(1, order_of("page-a")).has_value());
  EXPECT_FALSE(lanes.scan(1, "MOS2A45130007", "me").has_value());
  EXPECT_FALSE(lanes.confirm_side(1, "page-a").has_value()) << "a jig run asks for no side";
}

// A run without a name is no one's in words, either.
TEST(Lane, ABusyLaneIsSaidInAWholeSentenceWithoutAName) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007"}, folder.path());
  station.wait_state(1, "idle");
  Lanes& lanes = *station.lanes;
  StartOrder order = order_of("page-a");
  order.operator_name = {};
  ASSERT_TRUE(lanes.start(1, order).has_value());
  EXPECT_EQ(lanes.start(1, order).error().what, "this lane is at work already");
  station.wait_state(1, "running");
  EXPECT_EQ(lanes.command(1, "page-b", OperatorCommand::stop).error().what,
            "this lane is at work already");
}

// A stop of a motorised jig holds over a replug and over the next start, until a person says that
// the jig is free.
TEST(Lane, AStoppedJigMovesOnlyAfterTheOperatorsWord) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,jig=auto,pace=4";
  const auto bench = std::make_shared<mocks::VirtualBench>();
  Station station({device}, folder.path(), 24, bench);
  station.start("/api/run");
  station.wait(1, [&](const Json&) { return bench->motor(device)->movements > 1; });
  EXPECT_FALSE(station.lanes->release_jig(1, "me", "Ada").has_value()) << "not while it works";
  ASSERT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
  const Json done = station.wait_state(1, "done");
  EXPECT_EQ(done["result"]["verdict"], "stopped") << done.dump(1);
  EXPECT_EQ(done["jig_fault"], "emergency stop");
  EXPECT_EQ(station.post("/api/run", Json::object()), 409);
  ASSERT_EQ(station.post("/api/lanes/1/hand", {{"do", "unplug"}}), 200);
  station.wait_state(1, "absent");
  EXPECT_EQ(station.post("/api/lanes/1/jig-free", Json::object()), 409)
      << "it would be carried out when no one looks";
  ASSERT_EQ(station.post("/api/lanes/1/hand", {{"do", "plug"}}), 200);
  station.wait_state(1, "idle");
  station.wait(1, [](const Json& json) { return json["jig_fault"] == "emergency stop"; });
  EXPECT_EQ(station.post("/api/run", Json::object()), 409) << "a replug is no word";
  EXPECT_EQ(bench->motor(device)->movements_after_stop, 0);
  ASSERT_OK(bench->hands_out(device));
  ASSERT_EQ(station.post("/api/lanes/1/jig-free", Json::object()), 200);
  station.wait(1, [](const Json& json) { return json["jig_fault"].is_null(); });
  const int before = bench->motor(device)->movements;
  ASSERT_EQ(station.post("/api/run", Json::object()), 202);
  station.wait(1, [&](const Json&) { return bench->motor(device)->movements > before; });
  EXPECT_EQ(bench->motor(device)->movements_after_stop, 0);
}

// The log says who looked at the jig, not whose run was stopped.
TEST(Lane, TheWordAboutTheJigHasTheNameOfWhoGaveIt) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,jig=auto,pace=4";
  const auto bench = std::make_shared<mocks::VirtualBench>();
  Station station({device}, folder.path(), 24, bench);
  Operators operators(posix_env(), folder / "operators.json");
  for (const char* signs : {"", "Eve"}) {
    ASSERT_TRUE(station
                    .wait(1,
                          [](const Json& json) {
                            return json["state"] == "idle" || json["state"] == "done";
                          })
                    .is_object());
    const int before = bench->motor(device)->movements;
    ASSERT_TRUE(station.lanes->start(1, order_of("me")).has_value());
    station.wait(1, [&](const Json&) { return bench->motor(device)->movements > before + 1; });
    ASSERT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
    station.wait(1, [](const Json& json) {
      return json["state"] == "done" && json["jig_fault"] == "emergency stop";
    });
    if (*signs != '\0') {
      ASSERT_OK(operators.add(signs, OperatorRole::technician, "471100"));
      ASSERT_EQ(station.post("/api/operator", {{"name", signs}, {"pin", "471100"}}), 200);
    }
    ASSERT_OK(bench->hands_out(device));
    ASSERT_EQ(station.post("/api/lanes/1/jig-free", Json::object()), 200);
    const Json lane = station.wait(1, [](const Json& json) { return json["jig_fault"].is_null(); });
    EXPECT_EQ(lane["operator"], "Ada") << "of the run";
    EXPECT_EQ(lane["log"].back()["text"],
              std::string(*signs != '\0' ? signs : "someone") + " says that the jig is free");
  }
}

// The lane's thread is held in the store while the word is given, longer than a word holds.
TEST(Lane, AnOldWordThatAJigIsFreeIsNotCarriedOut) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,jig=auto,pace=4";
  const auto bench = std::make_shared<mocks::VirtualBench>();
  Station station({device}, folder.path(), 24, bench);
  station.start("/api/run");
  station.wait(1, [&](const Json&) { return bench->motor(device)->movements > 1; });
  {
    const std::unique_lock held(station.mutex);
    ASSERT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
    station.wait_state(1, "done");
    ASSERT_OK(bench->hands_out(device));
    ASSERT_TRUE(station.lanes->release_jig(1, "me", "Ada").has_value());
    std::this_thread::sleep_for(from_seconds(kOrderLife_s + 0.2));
  }
  const Json lane = station.wait(1, [](const Json& json) {
    return json["log"].dump().find("not released") != std::string::npos;
  });
  EXPECT_EQ(lane["jig_fault"], "emergency stop") << "no one looks at it any more";
  EXPECT_EQ(station.post("/api/run", Json::object()), 409);
}

// An order names the unit that was scanned: another one is not measured.
TEST(Lane, AnOrderForAnotherUnitIsRefusedUntilTheRightOneIsScanned) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007"}, folder.path());
  station.wait_state(1, "idle");
  StartOrder order = order_of("page-a");
  order.serial = "MOS2A45130008";
  const auto refused = station.lanes->start(1, order);
  ASSERT_FALSE(refused.has_value());
  EXPECT_THAT(refused.error().what, testing::HasSubstr("MOS2A45130008"));
  EXPECT_THAT(refused.error().what, testing::HasSubstr("MOS2A45130007"));
  order.serial.clear();
  EXPECT_FALSE(station.lanes->start(1, order).has_value()) << "the wrong label still counts";
  EXPECT_TRUE(station.lanes->scan(1, "MOS2A45130007", "me").has_value());
  EXPECT_TRUE(station.lanes->start(1, order).has_value());
}

// The lane's thread is held in the store while the order is given and the unit is exchanged.
TEST(Lane, AStartDiesWithItsUnit) {
  const tests::TemporaryFolder folder;
  const std::string device = "virtual:seed=7,serial=MOS2A45130007,jig=auto";
  const auto bench = std::make_shared<mocks::VirtualBench>();
  Station station({device}, folder.path(), 24, bench);
  {
    const std::unique_lock held(station.mutex);
    station.start("/api/run");
    station.wait_state(1, "done");
    StartOrder order = order_of("me");
    order.write = true;
    ASSERT_TRUE(station.lanes->start(1, order).has_value());
    ASSERT_OK(bench->swap(device, 8, "MOS2A45130008"));
  }
  const Json lane = station.wait(1, [](const Json& json) {
    return json["unit"].is_object() && json["unit"]["serial"] == "MOS2A45130008";
  });
  EXPECT_TRUE(lane["run"].is_null()) << lane.dump(1);
  EXPECT_THAT(lane["log"].dump(), testing::HasSubstr("not started"));
  EXPECT_EQ(bench->motor(device)->movements, 0) << "of the new unit's jig";
  const std::lock_guard lock(station.mutex);
  EXPECT_EQ(station.reports.size(), 1U);
}

// The client that takes a run over commands it from then on; without a name the operator stays.
TEST(Lane, TakingOverChangesTheClientAndTheOperatorWhereOneIsNamed) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_TRUE(station.lanes->start(1, order_of("page-a")).has_value());
  station.wait_state(1, "running");
  ASSERT_TRUE(station.lanes->take_over(1, "page-b", "").has_value());
  EXPECT_EQ(station.lane(1)["client"], public_name("page-b"));
  EXPECT_EQ(station.lane(1)["operator"], "Ada");
  EXPECT_FALSE(station.lanes->command(1, "page-a", OperatorCommand::stop).has_value());
  ASSERT_TRUE(station.lanes->take_over(1, "page-b", "Bo").has_value());
  EXPECT_EQ(station.lane(1)["operator"], "Bo");
  EXPECT_TRUE(station.lanes->command(1, "page-b", OperatorCommand::stop).has_value());
  station.wait_state(1, "done");
  const std::lock_guard lock(station.mutex);
  ASSERT_EQ(station.operators.size(), 1U);
  EXPECT_EQ(station.operators[0], "Ada, then Bo") << "the record names both";
}

}  // namespace
}  // namespace sixpoint::station
