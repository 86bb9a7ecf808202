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

}  // namespace
}  // namespace sixpoint::station
