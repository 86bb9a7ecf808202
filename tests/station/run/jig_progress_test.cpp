#include "station/run/jig_progress.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"

namespace sixpoint::station {
namespace {

JigProgress progress() {
  PoseReading face;
  face.pose = Pose::minus_x;
  face.mean_lsb = {-230.5, 41.25, 39};
  face.sd_lsb = {1, 1.5, 2};
  face.samples = 600;
  face.temperature_c = 24.5;
  face.tilt_deg = 0.25;
  PoseReading again = face;
  again.from = Pose::plus_z;
  again.turned_deg = 0;
  PoseReading turned = face;
  turned.turned_deg = 180;
  return {JigPhase::verifying, {face}, {again}, {}, {}, 3, {turned}};
}

TEST(JigProgress, IsReadAsItWasWritten) {
  const auto json = to_json(progress());
  EXPECT_EQ(json["phase"], "verifying");
  EXPECT_EQ(json["faces"][0]["pose"], "-x");
  EXPECT_TRUE(json["faces"][0]["from"].is_null());
  const auto read = parse_jig_progress(json);
  ASSERT_OK(read);
  EXPECT_EQ(read->phase, JigPhase::verifying);
  EXPECT_EQ(read->refusals, 3);
  ASSERT_EQ(read->reversed.size(), 1U);
  EXPECT_EQ(read->reversed[0].from, Pose::plus_z);
  EXPECT_EQ(read->reversed[0].mean_lsb[0], -230.5);
  ASSERT_EQ(read->half_turn.size(), 1U);
  EXPECT_EQ(read->half_turn[0].turned_deg, 180);
  EXPECT_EQ(read->reversed[0].turned_deg, 0);
  EXPECT_FALSE(read->faces[0].turned_deg.has_value());
  EXPECT_FALSE(json["faces"][0].contains("turned_deg")) << "as it was before production+";
  EXPECT_EQ(to_json(*read), json);
}

TEST(JigProgress, AStateOfAnEarlierVersionIsRead) {
  auto earlier = to_json(progress());
  earlier.erase("half_turn");
  const auto read = parse_jig_progress(earlier);
  ASSERT_OK(read);
  EXPECT_TRUE(read->half_turn.empty());
}

TEST(JigProgress, AnotherDocumentIsRefused) {
  const auto good = to_json(progress());
  for (const char* key : {"phase", "refusals", "faces", "reversed", "reseat", "recheck"}) {
    auto lacking = good;
    lacking.erase(key);
    EXPECT_FALSE(parse_jig_progress(lacking)) << key;
  }
  auto wrong = good;
  wrong["phase"] = "resting";
  EXPECT_EQ(parse_jig_progress(wrong).error().code, ErrorCode::bad_data);
  wrong = good;
  wrong["faces"][0]["pose"] = "+w";
  EXPECT_EQ(parse_jig_progress(wrong).error().code, ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::station
