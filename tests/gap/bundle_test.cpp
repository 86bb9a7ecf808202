// Hostile bundles: a clear error or a stated loss, never a confident guess.
#include "gap/bundle.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gap/diagnose.h"
#include "sim/recording.h"
#include "sim/scenario.h"

namespace sixpoint::gap {
namespace {

using Json = nlohmann::ordered_json;

// Three poses of ten seconds, recorded by the simulator; the protocol is written here.
class BundleTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto scenario = sim::parse_scenario(R"({
      "schema": "sixpoint/scenario/1", "seed": 3, "rate_hz": 100, "record": "activity2", "turn_s": 0,
      "motions": [{"kind": "still", "duration_s": 10, "pose": "+x"},
                  {"kind": "still", "duration_s": 10, "pose": "+y"},
                  {"kind": "still", "duration_s": 10, "pose": "+z"}]})");
    ASSERT_OK(scenario);
    ASSERT_OK(memory_.files.make_folders("b"));
    ASSERT_OK(sim::write_recording(memory_.files, "b/recording.gt3x", *scenario));
    protocol_ = Json::parse(R"({"schema": "sixpoint/bundle/1", "sample_rate_hz": 100,
      "accel_scale_lsb_per_g": 256, "gravity_g": 1.0, "unit": {}, "segments": [
      {"name": "faces", "kind": "still", "first_sample": 0, "samples": 1000, "host_start_s": 30,
       "rotation": [[0,0,1],[1,0,0],[0,1,0]], "temperature_c": 23},
      {"name": "faces", "kind": "still", "first_sample": 1000, "samples": 1000, "host_start_s": 45,
       "rotation": [[0,1,0],[0,0,1],[1,0,0]], "temperature_c": 23},
      {"name": "faces", "kind": "still", "first_sample": 2000, "samples": 1000, "host_start_s": 60,
       "rotation": [[1,0,0],[0,1,0],[0,0,1]], "temperature_c": [23, 24]}]})");
  }
  Result<Bundle> read() {
    if (memory_.files.info("b/protocol.json")) {
      (void)memory_.files.remove("b/protocol.json");
    }
    EXPECT_OK(write_file(memory_.files, "b/protocol.json", protocol_.dump()));
    return read_bundle(memory_.files, "b");
  }
  MemoryEnv memory_;
  Json protocol_;
};

TEST_F(BundleTest, GoodOneIsReadAndLossesAreSaid) {
  const auto bundle = read();
  ASSERT_OK(bundle);
  EXPECT_EQ(bundle->samples.size(), 3000U);
  EXPECT_EQ(bundle->segments[2].placement, 2);
  EXPECT_EQ(bundle->segments[1].approach_g, Eigen::Vector3d(-1, 1, 0));
  EXPECT_EQ(bundle->losses.size(), 2U) << "temperature.csv and host_clock.csv are missing";
  EXPECT_NEAR(bundle->temperature_at(65), 23.5, 1e-9) << "commanded, half-way up the ramp";
}

TEST_F(BundleTest, MissingFilesAreNoInput) {
  EXPECT_FAILS(read_bundle(memory_.files, "nowhere"), ErrorCode::no_input);
  ASSERT_OK(read());
  ASSERT_OK(memory_.files.remove("b/recording.gt3x"));
  EXPECT_FAILS(read(), ErrorCode::no_input);
}

TEST_F(BundleTest, ContradictionsAreBadData) {
  const Json good = protocol_;
  const auto fails = [&](const char* pointer, const Json& value) {
    protocol_ = good;
    protocol_[Json::json_pointer(pointer)] = value;
    SCOPED_TRACE(std::string(pointer) + " = " + value.dump());
    EXPECT_FAILS(read(), ErrorCode::bad_data);
  };
  fails("/schema", "sixpoint/bundle/9");
  fails("/sample_rate_hz", 0);
  fails("/sample_rate_hz", "100");
  fails("/sample_rate_hz", 30);  // the recording says 100
  fails("/gravity_g", nullptr);  // what NaN becomes in JSON
  fails("/segments", Json::array());
  fails("/segments/0/rotation", Json::parse("[[0,0,1],[1,0,0],[0,1,1]]"));   // not orthonormal
  fails("/segments/0/rotation", Json::parse("[[0,0,1],[1,0,0],[0,-1,0]]"));  // a reflection
  fails("/segments/0/rotation", Json::parse("[[0,0,1],[1,0,0]]"));
  fails("/segments/2/samples", 1001);  // beyond the end
  fails("/segments/2/samples", -5);
  fails("/segments/2/samples", 1e18);
  fails("/segments/1/first_sample", 999);  // overlap
  fails("/segments/1/first_sample", 1000.5);
  fails("/segments/1/host_start_s", 10);  // before the one before
  fails("/segments/1/kind", "dance");
  fails("/segments/1/kind", "vibration");  // without saying which
  fails("/segments/1/host_start_s", nullptr);
  fails("/segments/1/rotation/0/0", 1e308);
  for (const char* tone :
       {R"({"direction_lab": [0, 0, 1], "frequency_hz": 9999, "amplitude_g": 1})",
        R"({"direction_lab": [0, 0, 1], "frequency_hz": 9, "amplitude_g": 900})",
        R"({"direction_lab": [0, 1, 1], "frequency_hz": 9, "amplitude_g": 1})"}) {
    protocol_ = good;
    protocol_["segments"][1]["kind"] = "vibration";
    protocol_["segments"][1]["vibration"] = Json::parse(tone);
    SCOPED_TRACE(tone);
    EXPECT_FAILS(read(), ErrorCode::bad_data);
  }
  fails("/segments/1/temperature_c", "warm");
  protocol_ = Json::array();
  EXPECT_FAILS(read(), ErrorCode::bad_data);
}

TEST_F(BundleTest, AnotherUnitsRecordingIsSaid) {
  protocol_["unit"]["serial"] = "MOS2E99999999";
  const auto bundle = read();
  ASSERT_OK(bundle);
  EXPECT_NE(bundle->losses.front().find("MOS2E99999999"), std::string::npos)
      << bundle->losses.front();
}

TEST_F(BundleTest, LogsOfNonsenseAreLossesNotCrashes) {
  ASSERT_OK(write_file(memory_.files, "b/temperature.csv",
                       "host_time_s,temperature_c\nnan,nan\n1,9e99\n,,\n"));
  ASSERT_OK(write_file(memory_.files, "b/host_clock.csv",
                       "sample_index,host_time_s\n-1,2\n99999999,3\n0.5,1\n"));
  const auto bundle = read();
  ASSERT_OK(bundle);
  EXPECT_GE(bundle->losses.size(), 2U);
  EXPECT_TRUE(bundle->host_clock.empty());
}

TEST_F(BundleTest, LiteralsThatAreNoJsonAreBadData) {
  for (const char* literal : {"NaN", "Infinity", "-Infinity", "1e999"}) {
    std::string text = protocol_.dump();
    text.replace(text.find("1.0"), 3, literal);
    (void)memory_.files.remove("b/protocol.json");
    ASSERT_OK(write_file(memory_.files, "b/protocol.json", text));
    SCOPED_TRACE(literal);
    EXPECT_FAILS(read_bundle(memory_.files, "b"), ErrorCode::bad_data);
  }
}

TEST_F(BundleTest, TooManySegmentsAreRefused) {
  Json many = Json::array();
  Json one = protocol_["segments"][0];
  one["samples"] = 1;
  for (int i = 0; i < 5001; ++i) {
    one["first_sample"] = i;
    many.push_back(one);
  }
  protocol_["segments"] = many;
  EXPECT_FAILS(read(), ErrorCode::bad_data);
}

TEST_F(BundleTest, AForeignHostClockIsALoss) {
  std::string stamps = "sample_index,host_time_s\n";
  for (int i = 0; i < 30; ++i) {
    stamps += std::to_string(100 * i) + ",5\n";
  }
  ASSERT_OK(write_file(memory_.files, "b/host_clock.csv", stamps));
  const auto bundle = read();
  ASSERT_OK(bundle);
  EXPECT_TRUE(bundle->host_clock.empty());
  EXPECT_NE(bundle->losses.back().find("contradicts"), std::string::npos);
}

// Constant, all zero, all at one end of the range: nothing is named.
TEST_F(BundleTest, DeadDataNamesNothing) {
  const auto bundle = read();
  ASSERT_OK(bundle);
  for (const gt3x::Counts value : {gt3x::Counts{17, 256, -3}, gt3x::Counts{0, 0, 0},
                                   gt3x::Counts{2047, 2047, 2047}, gt3x::Counts{-2048, 2047, 0}}) {
    Bundle dead = *bundle;
    std::fill(dead.samples.begin(), dead.samples.end(), value);
    const auto diagnosis = diagnose(dead);
    ASSERT_OK(diagnosis);
    EXPECT_TRUE(diagnosis->inconclusive) << value[0];
    EXPECT_TRUE(diagnosis->effects.empty()) << diagnosis->effects.front().name;
    EXPECT_TRUE(diagnosis->unknown.present);
    EXPECT_FALSE(diagnosis->losses.empty());
  }
}

TEST_F(BundleTest, FewPosesGiveNoConfidentGuess) {
  const auto bundle = read();
  ASSERT_OK(bundle);
  const auto diagnosis = diagnose(*bundle);
  ASSERT_OK(diagnosis);
  EXPECT_FALSE(diagnosis->losses.empty());
  EXPECT_GT(diagnosis->not_observable.size(), 10U);
  protocol_["segments"] = Json::array({protocol_["segments"][0]});
  const auto one = read();
  ASSERT_OK(one);
  const auto alone = diagnose(*one);
  ASSERT_OK(alone);
  for (const EffectFinding& effect : alone->effects) {
    EXPECT_NE(effect.name, "misalignment") << "one pose can't show it";
    EXPECT_NE(effect.name, "tilt");
  }
}

}  // namespace
}  // namespace sixpoint::gap
