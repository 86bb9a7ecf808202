// Which client commands a lane, and which unit it may measure.
#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

TEST(Lanes, TwoOperatorsOnOneLane) {
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

TEST(Lanes, TheScannedSerialMustBeTheUnitsOwn) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:serial=MOS2A45130007", "virtual:serial=MOS2A45130008"}, folder.path());
  station.wait_state(1, "idle");
  station.wait_state(2, "idle");
  EXPECT_EQ(station.post("/api/scan", {{"serial", "MOS2A45130008"}}), 200);
  EXPECT_EQ(station.lane(2)["scan"]["matches"], true);
  EXPECT_EQ(station.post("/api/scan", {{"serial", "MOS2A00000000"}}), 409);
  EXPECT_EQ(station.post("/api/lanes/1/scan", {{"serial", "MOS2A45130008"}}), 409);
  EXPECT_EQ(station.lane(1)["scan"]["matches"], false);
  EXPECT_EQ(station.post("/api/run", {{"lane", 1}}), 409) << "the label is another unit's";
  EXPECT_EQ(station.post("/api/lanes/1/scan", {{"serial", "MOS2A45130007"}}), 200);
}

}  // namespace
}  // namespace sixpoint::station
