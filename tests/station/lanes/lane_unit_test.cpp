// A lane without a run: its unit is found, shown, pulled out, put back and exchanged.
#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

constexpr const char* kUnitDevice = "virtual:seed=7,serial=MOS2A45130007,pace=20";

int hand(const Station& station, const Json& body) {
  return station.post("/api/lanes/1/hand", body);
}

// The number of the next reading.
std::uint64_t readings(const Station& station) {
  return station.lanes->trace(1, ~std::uint64_t{0}).first;
}

// Waits until a reading has come that is not among the first `seen`.
bool comes_more_than(const Station& station, std::uint64_t seen) {
  for (int i = 0; i < 3000; ++i) {
    if (readings(station) > seen) {
      return true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

TEST(LaneUnit, ReadingsComeWhileNothingRuns) {
  const tests::TemporaryFolder folder;
  Station station({kUnitDevice}, folder.path());
  station.wait_state(1, "idle");
  EXPECT_TRUE(comes_more_than(station, 0));
  EXPECT_TRUE(comes_more_than(station, readings(station)));
  EXPECT_EQ(station.lanes->state(1), LaneState::idle);
}

TEST(LaneUnit, AUnitThatIsPulledOutIsNoticedAndAgainWhenItIsBack) {
  const tests::TemporaryFolder folder;
  Station station({kUnitDevice}, folder.path());
  station.wait_state(1, "idle");
  ASSERT_TRUE(comes_more_than(station, 0));
  ASSERT_EQ(hand(station, {{"do", "unplug"}}), 200);
  EXPECT_TRUE(station.wait_state(1, "absent")["unit"].is_null());
  const std::uint64_t seen = readings(station);
  EXPECT_TRUE(station.lanes->live(1)["face"].is_null()) << "no one knows how it lies now";
  ASSERT_EQ(hand(station, {{"do", "plug"}}), 200);
  EXPECT_EQ(station.wait_state(1, "idle")["unit"]["serial"], "MOS2A45130007");
  EXPECT_TRUE(comes_more_than(station, seen));
}

// What was measured is shown until the next start, with the serial number of its unit: the unit is
// out, or another one is in, when a person reads it.
TEST(LaneUnit, AResultStaysUntilTheNextStart) {
  const tests::TemporaryFolder folder;
  Station station({kUnitDevice}, folder.path());
  station.start("/api/run");
  station.wait_state(1, "running");
  ASSERT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
  EXPECT_EQ(station.wait_state(1, "done")["result"]["verdict"], "stopped");
  ASSERT_EQ(hand(station, {{"do", "unplug"}}), 200);
  station.wait_state(1, "absent");
  ASSERT_EQ(hand(station, {{"do", "plug"}}), 200);
  EXPECT_EQ(station.wait_state(1, "idle")["result"]["serial"], "MOS2A45130007");
  ASSERT_EQ(hand(station, {{"do", "swap"}, {"serial", "MOS2A45139999"}}), 200);
  const Json other = station.wait(1, [](const Json& json) {
    return json["unit"].is_object() && json["unit"]["serial"] == "MOS2A45139999";
  });
  EXPECT_EQ(other["result"]["serial"], "MOS2A45130007");
  EXPECT_TRUE(other["run"].is_null());
  EXPECT_EQ(other["log"], Json::array());
  EXPECT_EQ(station.post("/api/run", Json::object()), 202);
  EXPECT_TRUE(station.wait_state(1, "running")["result"].is_null());
}

// While a run waits for its unit it can be stopped; it ends as stopped, with the unit's name.
TEST(LaneUnit, ARunThatWaitsForItsUnitCanBeStopped) {
  const tests::TemporaryFolder folder;
  Station station({kUnitDevice}, folder.path());
  station.start("/api/run");
  place_unit(station, 1, 1);
  station.wait(1, [](const Json& json) { return json["run"]["taken"].size() == 1; });
  ASSERT_EQ(hand(station, {{"do", "unplug"}}), 200);
  const Json away = station.wait_state(1, "unit_away");
  EXPECT_EQ(away["message"], "plug unit MOS2A45130007 in again");
  EXPECT_EQ(away["log"].back()["kind"], "away");
  ASSERT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
  // The lane is done for a moment only, then it says that its unit is absent.
  const Json done = station.wait(1, [](const Json& json) { return json["result"].is_object(); });
  EXPECT_EQ(done["result"]["verdict"], "stopped");
  EXPECT_EQ(done["result"]["serial"], "MOS2A45130007");
}

// Lanes do not disturb each other: one loses its unit, the other's readings go on.
TEST(LaneUnit, EachLaneHasItsOwnUnit) {
  const tests::TemporaryFolder folder;
  Station station({kUnitDevice, "virtual:seed=8,serial=MOS2A45130008,pace=20"}, folder.path());
  station.wait_state(1, "idle");
  station.wait_state(2, "idle");
  ASSERT_EQ(station.post("/api/lanes/2/hand", {{"do", "unplug"}}), 200);
  station.wait_state(2, "absent");
  EXPECT_TRUE(comes_more_than(station, readings(station)));
  EXPECT_EQ(station.lane(1)["unit"]["serial"], "MOS2A45130007");
}

}  // namespace
}  // namespace sixpoint::station
