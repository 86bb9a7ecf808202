// Which unit a lane may measure, and which lane a label means.
#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

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

// A label that no lane holds: the person who scanned it starts nothing, until the right unit is
// there, its label is scanned, or the scan is dismissed. Others are not held up.
TEST(Lanes, ALabelThatNoLaneHoldsBlocksTheStartOfWhoScannedIt) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,pace=20",
                   "virtual:seed=8,serial=MOS2A45130008,pace=20"},
                  folder.path());
  station.wait_state(1, "idle");
  station.wait_state(2, "idle");
  const auto scan = [&](const std::string& label) {
    return station.post("/api/scan", {{"serial", label}});
  };
  EXPECT_EQ(scan("sixpoint:MOS2A45139999:0f"), 409);
  for (const char* path : {"/api/run", "/api/capture"}) {
    EXPECT_EQ(station.post(path, {{"lane", 1}}), 409) << path;
    EXPECT_EQ(station.post(path, {{"lane", 2}}), 409) << path;
  }
  EXPECT_EQ(station.post("/api/run", {{"lane", 2}}, "another"), 202);
  EXPECT_EQ(station.post("/api/scan", {{"dismiss", true}}), 200);
  EXPECT_EQ(station.post("/api/run", {{"lane", 1}}), 202);
  station.wait_state(1, "running");
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object()), 200);
  station.wait_state(1, "done");
  // The unit that was scanned comes.
  EXPECT_EQ(scan("MOS2A45130001"), 409);
  EXPECT_EQ(station.post("/api/run", {{"lane", 1}}), 409);
  EXPECT_EQ(station.post("/api/lanes/1/hand", {{"do", "swap"}, {"serial", "MOS2A45130001"}}), 200);
  station.wait(1, [](const Json& json) {
    return json["unit"].is_object() && json["unit"]["serial"] == "MOS2A45130001";
  });
  EXPECT_EQ(station.post("/api/run", {{"lane", 1}}), 202);
  EXPECT_EQ(scan("no label of ours"), 400);
}

// Browsers that were left behind do not take the place of those that are used.
TEST(Lanes, TheScanOfAClientBehindManyOthersBlocksItsStart) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,serial=MOS2A45130007,pace=20"}, folder.path());
  station.wait_state(1, "idle");
  const Json label = {{"serial", "MOS2A45139999"}};
  for (int i = 0; i < 300; ++i) {
    ASSERT_EQ(station.post("/api/scan", label, "c" + std::to_string(i)), 409);
    ASSERT_EQ(station.post("/api/scan", label, "c" + std::to_string(i)), 409) << "again";
  }
  EXPECT_EQ(station.post("/api/run", {{"lane", 1}}, "c299"), 409);
  EXPECT_EQ(station.post("/api/run", {{"lane", 1}}, "c44"), 409) << "the 256th from the end";
  EXPECT_EQ(station.post("/api/run", {{"lane", 1}}, "c0"), 202) << "the oldest are forgotten";
}

}  // namespace
}  // namespace sixpoint::station
