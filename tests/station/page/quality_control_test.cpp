#include "station/page/quality_control.h"

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "temporary_folder.h"

namespace sixpoint::station {

using Json = nlohmann::ordered_json;

namespace {

db::StationEvent check_unit(const std::string& serial, const std::string& reason) {
  db::StationEvent event;
  event.action = "check_unit";
  event.serial = serial;
  event.operator_name = "Eve";
  event.reason = reason;
  return event;
}

class QualityControlTest : public testing::Test {
 protected:
  Result<db::Store> open() { return db::Store::open(posix_env(), folder_ / "s.db"); }

  tests::TemporaryFolder folder_;
  QualityControl quality_{[this] { return open(); }, "bench-1", default_limits(),
                          posix_env().clock};
};

TEST_F(QualityControlTest, ADecisionNeedsANameAndAReasonAndIsInTheStore) {
  db::StationEvent decision = check_unit("MOS2A1", " \t");
  EXPECT_FAILS(quality_.decide(decision), ErrorCode::usage);
  decision.reason = "checks bench 1";
  decision.operator_name = "";
  EXPECT_FAILS(quality_.decide(decision), ErrorCode::usage);
  decision.operator_name = "Eve";
  ASSERT_OK(quality_.decide(decision));
  const auto events = open()->station_events();
  ASSERT_OK(events);
  ASSERT_EQ(events->size(), 1U);
  EXPECT_EQ(events->front().station, "bench-1");
  EXPECT_EQ(events->front().operator_name, "Eve");
  EXPECT_EQ(quality_.lock()["check_units"], Json::array({"MOS2A1"}));
  EXPECT_EQ(quality_.lock()["locked"], false);
}

TEST_F(QualityControlTest, ADecisionOfAnotherStationIsFoundAfterARefresh) {
  db::StationEvent event = check_unit("MOS2A2", "checks bench 2");
  event.station = "bench-2";
  ASSERT_OK(open()->add_station_event(event));
  quality_.refresh_soon();
  const Json expected = Json::array({"MOS2A2"});
  for (int i = 0; i < 1000 && quality_.lock()["check_units"] != expected; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(quality_.lock()["check_units"], expected);
  EXPECT_GT(quality_.changes(), 0U);
}

TEST_F(QualityControlTest, AnEmptyStoreHasNoRunsAndNoStudies) {
  const auto statistics = quality_.statistics({});
  ASSERT_OK(statistics);
  EXPECT_EQ((*statistics)["all"]["runs"], 0);
  EXPECT_EQ((*quality_.studies())["studies"], Json::array());
  EXPECT_FAILS(quality_.statistics({"station", "31.3.2027", ""}), ErrorCode::usage);
  EXPECT_FAILS(quality_.statistics({"moon", "", ""}), ErrorCode::usage);
  GageQuery query;
  query.study = "autumn";
  EXPECT_FAILS(quality_.gage_study(query), ErrorCode::no_input);
}

// A defect that throws ends no thread of the station. Oracle: the state of before and the next.
TEST(QualityControlDefect, IsShownAsAProblemAndTheNextRefreshSucceeds) {
  const tests::TemporaryFolder folder;
  std::atomic<bool> is_defect{true};
  QualityControl quality(
      [&]() -> Result<db::Store> {
        if (is_defect) {
          throw std::runtime_error("made by the test");
        }
        return db::Store::open(posix_env(), folder / "s.db");
      },
      "bench-1", default_limits(), posix_env().clock);
  const auto problem_is_shown = [&](bool wanted) {
    for (int i = 0; i < 1000 && (quality.lock()["problem"] != "") != wanted; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return (quality.lock()["problem"] != "") == wanted;
  };
  ASSERT_TRUE(problem_is_shown(true));
  EXPECT_EQ(quality.lock()["problem"],
            "a defect of the program ended the look into the store: made by the test");
  EXPECT_EQ(quality.lock()["locked"], false);
  is_defect = false;
  quality.refresh_soon();
  EXPECT_TRUE(problem_is_shown(false));
}

}  // namespace
}  // namespace sixpoint::station
