// What read_protocol() derives, worked out by hand. That its refusals reach read_bundle() is tested
// in bundle_test.cpp.
#include "gap/recording/protocol.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kUp = "[[1,0,0],[0,1,0],[0,0,1]]";         // +Z up
constexpr const char* kDown = "[[1,0,0],[0,-1,0],[0,0,-1]]";     // -Z up
constexpr const char* kSide = "[[0,0,1],[1,0,0],[0,1,0]]";       // +X up
constexpr const char* kUpTurned = "[[0,-1,0],[1,0,0],[0,0,1]]";  // +Z up, a quarter of a turn

Json segment(double host_start_s, const char* rotation, const char* kind = "still") {
  Json json = {{"name", "faces"}, {"kind", kind}, {"samples", 1000}, {"temperature_c", 23}};
  json["host_start_s"] = host_start_s;
  json["rotation"] = Json::parse(rotation);
  if (std::string(kind) == "vibration") {
    json["vibration"] = {{"direction_lab", {0, 0, 1}}, {"frequency_hz", 10}, {"amplitude_g", 0.5}};
  }
  return json;
}

// Segments of ten seconds, one after the other in the recording.
Json protocol(std::vector<Json> segments) {
  Json json = {{"schema", "sixpoint/bundle/1"},
               {"sample_rate_hz", 100},
               {"accel_scale_lsb_per_g", 341},
               {"gravity_g", 0.9983},
               {"unit", {{"serial", "MOS2E00000001"}}}};
  for (std::size_t i = 0; i < segments.size(); ++i) {
    segments[i]["first_sample"] = 1000 * i;
    json["segments"].push_back(segments[i]);
  }
  return json;
}

Result<Bundle> read_text(std::string_view text) {
  MemoryEnv memory;
  EXPECT_OK(write_file(memory.files, "protocol.json", text));
  Bundle bundle;
  SIXPOINT_CHECK(read_protocol(memory.files, "protocol.json", bundle));
  return bundle;
}
Result<Bundle> read(const Json& json) { return read_text(json.dump()); }

TEST(Protocol, ValuesOfAFileArriveInTheBundle) {
  Json json = protocol({segment(30, kUp), segment(50, kSide, "vibration"), segment(70, kUp, "ramp"),
                        segment(90, kUp, "soak")});
  json["segments"][2]["temperature_c"] = {23, 31.5};
  const auto bundle = read(json);
  ASSERT_OK(bundle);
  EXPECT_EQ(bundle->rate_hz, 100);
  EXPECT_EQ(bundle->accel_scale_lsb_per_g, 341);
  EXPECT_EQ(bundle->gravity_g, 0.9983);
  EXPECT_EQ(bundle->protocol_serial, "MOS2E00000001");
  ASSERT_EQ(bundle->segments.size(), 4U);
  const Segment& tone = bundle->segments[1];
  EXPECT_EQ(tone.name, "faces");
  EXPECT_EQ(tone.first_sample, 1000U);
  EXPECT_EQ(tone.samples, 1000U);
  EXPECT_EQ(tone.host_start_s, 50);
  EXPECT_EQ(tone.rotation.row(0), Eigen::RowVector3d(0, 0, 1)) << "rows are rows";
  ASSERT_TRUE(tone.vibration);
  EXPECT_EQ(tone.vibration->frequency_hz, 10);
  EXPECT_EQ(tone.vibration->amplitude_g, 0.5);
  EXPECT_EQ(bundle->segments[2].temperature_start_c, 23);
  EXPECT_EQ(bundle->segments[2].temperature_end_c, 31.5);
  EXPECT_EQ(bundle->segments[3].temperature_end_c, 23) << "one number is both";
  const Segment::Kind kinds[] = {Segment::Kind::still, Segment::Kind::vibration,
                                 Segment::Kind::ramp, Segment::Kind::soak};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(bundle->segments[i].kind, kinds[i]);
    EXPECT_EQ(bundle->segments[i].vibration.has_value(), i == 1);
  }
}

TEST(Protocol, DirectionOfAToneIsMadeOfUnitLength) {
  Json json = protocol({segment(30, kUp, "vibration")});
  json["segments"][0]["vibration"]["direction_lab"] = {0.6024, 0, 0.8032};  // 1.004 long
  const auto bundle = read(json);
  ASSERT_OK(bundle);
  EXPECT_LT((bundle->segments[0].vibration->direction_lab - Eigen::Vector3d(0.6, 0, 0.8)).norm(),
            1e-12);
}

TEST(Protocol, EqualRotationsHaveEqualPoseNumbersInOrderOfAppearance) {
  const auto bundle = read(protocol({segment(0, kSide), segment(20, kUp), segment(40, kSide),
                                     segment(60, kUpTurned), segment(80, kUp)}));
  ASSERT_OK(bundle);
  const int poses[] = {0, 1, 0, 2, 1};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(bundle->segments[i].pose, poses[i]) << i;
    EXPECT_EQ(bundle->segments[i].placement, static_cast<int>(i)) << "a pause of 10 s is a move";
  }
}

// The approach is the change of gravity in the sensor's frame: (0 0 g), (g 0 0), (0 0 -g).
TEST(Protocol, ApproachAndHeldSignAreThoseOfTheStepsByHand) {
  const auto bundle =
      read(protocol({segment(0, kUp), segment(20, kSide), segment(40, kDown), segment(60, kDown)}));
  ASSERT_OK(bundle);
  const double g = 0.9983;
  const auto& s = bundle->segments;
  EXPECT_EQ(s[0].approach_g, Eigen::Vector3d(0, 0, 0)) << "nothing was before";
  const auto held = [&](std::size_t i) { return Eigen::Vector3d(s[i].held_sign.col(kUsualStep)); };
  EXPECT_EQ(held(0), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(s[1].approach_g, Eigen::Vector3d(g, 0, -g));
  EXPECT_EQ(held(1), Eigen::Vector3d(1, 0, -1));
  EXPECT_EQ(s[2].approach_g, Eigen::Vector3d(-g, 0, -g));
  EXPECT_EQ(held(2), Eigen::Vector3d(-1, 0, -1));
  EXPECT_EQ(s[3].approach_g, Eigen::Vector3d(0, 0, 0)) << "put down again in the same pose";
  EXPECT_EQ(held(3), Eigen::Vector3d(-1, 0, -1)) << "no step, no change";
}

TEST(Protocol, SegmentThatFollowsWithoutAPauseIsOfTheSamePlacement) {
  const auto bundle =
      read(protocol({segment(0, kUp), segment(20, kSide), segment(30, kSide, "ramp"),
                     segment(40, kUp), segment(52, kUp)}));
  ASSERT_OK(bundle);
  const auto& s = bundle->segments;
  EXPECT_FALSE(s[2].starts_placement);
  EXPECT_EQ(s[2].placement, s[1].placement);
  EXPECT_EQ(s[2].approach_g, s[1].approach_g) << "that of the placement";
  EXPECT_TRUE(s[3].starts_placement) << "no pause, but another pose";
  EXPECT_TRUE(s[4].starts_placement) << "the same pose after a pause of 2 s";
  EXPECT_EQ(s[4].placement, 3);
}

TEST(Protocol, TonesOfOneShakerAxisAreOfOnePlacement) {
  Json other = segment(39, kUp, "vibration");
  other["name"] = "shaker_high";
  const auto bundle = read(protocol({segment(0, kUp, "vibration"), segment(13, kUp, "vibration"),
                                     segment(26, kSide, "vibration"), other}));
  ASSERT_OK(bundle);
  const bool starts[] = {true, false, true, true};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(bundle->segments[i].starts_placement, starts[i]) << i;
  }
  const auto far = read(protocol({segment(0, kUp, "vibration"), segment(16, kUp, "vibration")}));
  ASSERT_OK(far);
  EXPECT_TRUE(far->segments[1].starts_placement) << "a pause of 6 s";
}

TEST(Protocol, MissingFileIsNoInput) {
  MemoryEnv memory;
  Bundle bundle;
  EXPECT_FAILS(read_protocol(memory.files, "protocol.json", bundle), ErrorCode::no_input);
}

TEST(Protocol, EveryKeyIsWanted) {
  const Json good = protocol({segment(0, kUp), segment(20, kUp, "vibration")});
  ASSERT_OK(read(good));
  for (const char* pointer :
       {"/schema", "/sample_rate_hz", "/accel_scale_lsb_per_g", "/gravity_g", "/segments",
        "/segments/1/name", "/segments/1/kind", "/segments/1/first_sample", "/segments/1/samples",
        "/segments/1/host_start_s", "/segments/1/rotation", "/segments/1/temperature_c",
        "/segments/1/vibration", "/segments/1/vibration/direction_lab",
        "/segments/1/vibration/frequency_hz", "/segments/1/vibration/amplitude_g"}) {
    Json lacking = good;
    const Json::json_pointer at(pointer);
    lacking[at.parent_pointer()].erase(at.back());
    SCOPED_TRACE(pointer);
    EXPECT_FAILS(read(lacking), ErrorCode::bad_data);
  }
}

TEST(Protocol, ErrorNamesTheSegmentAndTheKey) {
  Json json = protocol({segment(0, kUp), segment(20, kUp)});
  json["segments"][1]["samples"] = 1.5;
  const auto refused = read(json);
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_EQ(refused.error().where, "protocol.json: segments[1]");
  EXPECT_NE(refused.error().what.find("'samples'"), std::string::npos) << refused.error().what;
}

// The last value that is taken beside the first that is not.
TEST(Protocol, LimitsAreWhereTheyAreSaidToBe) {
  const Json good = protocol({segment(0, kUp), segment(20, kUp, "vibration")});
  const auto with = [&](const char* pointer, const Json& value) {
    Json json = good;
    json[Json::json_pointer(pointer)] = value;
    return read(json);
  };
  EXPECT_OK(with("/segments/1/vibration/frequency_hz", 49.9));
  const auto folded = with("/segments/1/vibration/frequency_hz", 50);
  ASSERT_OK(folded) << "a shaker runs through its tones whatever the unit's rate is";
  EXPECT_EQ(folded->losses.size(), 1U);
  constexpr double k400Days_s = 400 * 86'400;  // the second segment lasts 10 s
  EXPECT_OK(with("/segments/1/host_start_s", k400Days_s - 10));
  EXPECT_FAILS(with("/segments/1/host_start_s", k400Days_s - 9), ErrorCode::bad_data);
  EXPECT_FAILS(with("/segments/0/host_start_s", 20 - k400Days_s), ErrorCode::bad_data);
  EXPECT_OK(read(protocol({segment(9.9e8, kUp), segment(9.9e8 + 20, kUp)})));
  EXPECT_OK(read(protocol({segment(-9.9e8, kUp), segment(-9.9e8 + 20, kUp)})));
  EXPECT_OK(with("/gravity_g", 0.9956));  // the least and the most on Earth
  EXPECT_OK(with("/gravity_g", 1.0028));
  EXPECT_FAILS(with("/gravity_g", 0.98), ErrorCode::bad_data);
  EXPECT_FAILS(with("/gravity_g", 9.80665), ErrorCode::bad_data);
  EXPECT_OK(with("/segments/1/first_sample", 1000));
  EXPECT_FAILS(with("/segments/1/first_sample", 999), ErrorCode::bad_data);
  EXPECT_OK(with("/segments/1/samples", 1));
  EXPECT_FAILS(with("/segments/1/samples", 0), ErrorCode::bad_data);
  EXPECT_OK(with("/segments/1/temperature_c", Json::parse("[-40, 85]")));
  EXPECT_FAILS(with("/segments/1/temperature_c", Json::parse("[1, 2, 3]")), ErrorCode::bad_data);
  EXPECT_FAILS(with("/segments/1/temperature_c", 300), ErrorCode::bad_data);
  EXPECT_OK(with("/segments/1/rotation/0/0", 1.0004));
  EXPECT_FAILS(with("/segments/1/rotation/0/0", 1.001), ErrorCode::bad_data);
}

TEST(Protocol, MoreThanAThousandSegmentsAreRefused) {
  const std::vector<Json> thousand(1'000, segment(0, kUp));
  EXPECT_OK(read(protocol(thousand)));
  std::vector<Json> more = thousand;
  more.push_back(segment(0, kUp));
  const auto refused = read(protocol(more));
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_NE(refused.error().what.find("diagnose parts of it"), std::string::npos);
}

TEST(Protocol, MirroredPoseIsCalledSo) {
  const auto refused = read(protocol({segment(0, "[[1,0,0],[0,1,0],[0,0,-1]]")}));
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_NE(refused.error().what.find("mirrors"), std::string::npos) << refused.error().what;
}

TEST(Protocol, TextThatIsNoJsonObjectIsRefused) {
  for (const char* text : {"", "{", "[]", "7", "{\"schema\": }", "\xff\xfe{}"}) {
    SCOPED_TRACE(text);
    EXPECT_FAILS(read_text(text), ErrorCode::bad_data);
  }
}

TEST(Protocol, SerialIsNotWantedAndIsMadePrintable) {
  for (const Json& unit :
       {Json(), Json(5), Json::array({1}), Json::object(), Json{{"serial", 7}}}) {
    Json json = protocol({segment(0, kUp)});
    json["unit"] = unit;
    const auto bundle = read(json);
    ASSERT_OK(bundle);
    EXPECT_EQ(bundle->protocol_serial, "") << unit;
  }
  Json json = protocol({segment(0, kUp)});
  json["unit"]["serial"] = "MOS\x1b[31m";
  const auto bundle = read(json);
  ASSERT_OK(bundle);
  EXPECT_EQ(bundle->protocol_serial.find('\x1b'), std::string::npos) << "a terminal would obey it";
}

}  // namespace
}  // namespace sixpoint::gap
