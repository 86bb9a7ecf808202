// Server-sent events: the state, and the readings that the box on the page follows.
#include <cmath>

#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

TEST(EventStream, EventsCarryStateLanesAndReadings) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,pace=20"}, folder.path());
  station.wait_state(1, "idle");
  std::string text;
  station.client().Get("/api/events", [&](const char* data, std::size_t size) {
    text.append(data, size);
    return text.find("event: live") == std::string::npos || text.size() < 4000;
  });
  EXPECT_THAT(text, testing::StartsWith("event: state\ndata: {\"schema\":\"sixpoint/station/1\""));
  const std::size_t live = text.find("event: live\ndata: ");
  ASSERT_NE(live, std::string::npos);
  const std::size_t begin = live + std::string("event: live\ndata: ").size();
  const Json json = Json::parse(text.substr(begin, text.find('\n', begin) - begin));
  ASSERT_FALSE(json["lanes"].empty());
  EXPECT_EQ(json["lanes"][0]["mg"].size() % 3, 0U);
  EXPECT_EQ(json["lanes"][0]["live"]["face"], "+z");
}

// How far from +z the box on the page stands: the newest reading of lane 1, as the page has it.
double shown_tilt_deg(const Station& station) {
  std::string text;
  Json json;
  station.client().Get("/api/events", [&](const char* data, std::size_t size) {
    text.append(data, size);
    const std::string head = "event: live\ndata: ";
    const std::size_t live = text.find(head);
    const std::size_t end = live == std::string::npos ? live : text.find('\n', live + head.size());
    if (end != std::string::npos) {
      const std::size_t begin = live + head.size();
      json = Json::parse(text.substr(begin, end - begin), nullptr, false);
      text.erase(0, end);
      return json["lanes"].empty() || json["lanes"][0]["mg"].size() < 3;
    }
    return true;
  });
  const auto mg = json["lanes"][0]["mg"].get<std::vector<double>>();
  const double z = mg[mg.size() - 1];
  return std::atan2(std::hypot(mg[mg.size() - 2], mg[mg.size() - 3]), z) * 180 / M_PI;
}

// A unit with constants of the other filter configuration lies right, and its box stood 25 degrees
// askew. Oracle: the virtual unit's true constants, which have it at +z.
TEST(EventStream, TheLiveBoxUsesTheConstantsThatTheRunHasFound) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,positive_lsb=305/302/280,negative_lsb=-205/-208/-228,"
                   "zero_lsb=50/47/26,true_sensitivity_lsb_per_g=237.7/251.8/242.3,"
                   "true_zero_lsb=-30/127/26,pace=20"},
                  folder.path());
  station.wait_state(1, "idle");
  EXPECT_GT(shown_tilt_deg(station), 20) << "by the unit's own constants";
  ASSERT_EQ(station.post("/api/run", Json::object()), 202);
  place_unit(station, 1, 1);
  station.wait(1, [](const Json& json) {
    return json["run"].is_object() && json["run"]["taken"].size() == 1;
  });
  // It lies where it lay. The reading that was taken may have been the last one shown by the old
  // ones.
  double shown_deg = shown_tilt_deg(station);
  for (int i = 0; i < 500 && shown_deg > 2; ++i) {
    shown_deg = shown_tilt_deg(station);
  }
  EXPECT_LT(shown_deg, 2) << "seating and noise of a single reading";
}

}  // namespace
}  // namespace sixpoint::station
