#include "sim/scenario.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "sim/recording.h"

namespace sixpoint::sim {
namespace {

constexpr const char* kWhole = R"({
  "schema": "sixpoint/scenario/1", "seed": 7,
  "unit": {"serial": "MOS2A45130007", "firmware": "1.5.0", "calibrated": "2013-11-12",
           "constants": {"positive_lsb": [311, 310, 287], "negative_lsb": [-204, -216, -234],
                         "zero_lsb": [54, 47, 26]},
           "sensor": {"current": {"sensitivity_lsb_per_g": [237.7, 251.8, 242.3],
                                  "zero_lsb": [49.9, 95.8, 60.8]}}},
  "start": "2015-04-09T14:04:00Z", "rate_hz": 30,
  "motions": [{"kind": "still", "duration_s": 20, "pose": "+z"},
              {"kind": "shaker", "duration_s": 5, "direction_lab": [1, 0, 0], "frequency_hz": 4},
              {"kind": "free_living", "duration_s": 60}],
  "effects": [{"name": "clock_error", "parameters": {"ppm": 40}},
              {"name": "tilt", "parameters": {"rotation_vector_deg": [0.1, 0, 0]}}]
})";

TEST(Scenario, ReadsAWholeOne) {
  const auto scenario = parse_scenario(kWhole);
  ASSERT_OK(scenario);
  EXPECT_EQ(scenario->unit.serial, "MOS2A45130007");
  EXPECT_EQ(scenario->unit.current.zero_lsb, (PerAxis<double>{49.9, 95.8, 60.8}));
  EXPECT_EQ(scenario->filter_in_force(), FilterConfiguration::current);
  EXPECT_EQ(scenario->motions.size(), 3U);
  EXPECT_EQ(scenario->effects.size(), 2U);
  EXPECT_DOUBLE_EQ(scenario->motion()->duration_s(), 20 + 2 + 5 + 2 + 60);
}

TEST(Scenario, RefusesWhatItDoesNotKnow) {
  for (
      const char* text : {
          "",
          "[]",
          "{}",
          R"({"motions": []})",
          R"({"motions": [{"kind": "fly"}]})",
          R"({"motions": [{}]})",
          R"({"motion": [{"kind": "still"}]})",
          R"({"motions": [{"kind": "still", "pose": "+w"}]})",
          R"({"motions": [{"kind": "still", "pose": "up"}]})",
          R"({"motions": [{"kind": "still", "pose": "+x", "up": [1, 0, 0]}]})",
          R"({"motions": [{"kind": "still", "up": [0, 0, 0]}]})",
          R"({"motions": [{"kind": "still", "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}]})",
          R"({"motions": [{"kind": "still", "rotation": [[1, 0], [0, 1]]}]})",
          R"({"motions": [{"kind": "still", "rotation": 5}]})",
          R"({"motions": [{"kind": "still", "duration_s": -1}]})",
          R"({"motions": [{"kind": "still", "duration_s": 1e300}]})",
          R"({"rate_hz": 0, "motions": [{"kind": "still"}]})",
          R"({"rate_hz": 30.5, "motions": [{"kind": "still"}]})",
          R"({"seed": -1, "motions": [{"kind": "still"}]})",
          R"({"schema": "sixpoint/scenario/2", "motions": [{"kind": "still"}]})",
          R"({"start": "1900-01-01", "motions": [{"kind": "still"}]})",
          R"({"filter": "new", "motions": [{"kind": "still"}]})",
          R"({"unit": 7, "motions": [{"kind": "still"}]})",
          R"({"unit": {"firmware": "beta"}, "motions": [{"kind": "still"}]})",
          R"({"unit": {"constants": {"zero_lsb": [1, 2]}}, "motions": [{"kind": "still"}]})",
          R"({"unit": {"constants": {"zero_lsb": [1, 2, 9999]}}, "motions": [{"kind": "still"}]})",
          R"({"unit": {"constants": {"positive_lsb": [1, 1, 1], "negative_lsb": [1, 1, 1]}},
               "motions": [{"kind": "still"}]})",
          R"({"effects": [{"name": "gremlins"}], "motions": [{"kind": "still"}]})",
          R"({"effects": [{"name": "tilt", "parameters": {"x": 1}}], "motions": [{"kind": "still"}]})",
      }) {
    SCOPED_TRACE(text);
    EXPECT_FAILS(parse_scenario(text), ErrorCode::configuration);
  }
}

TEST(Scenario, SameScenarioSameBytesAndTruth) {
  const Scenario scenario = *parse_scenario(kWhole);
  MemoryEnv env;
  std::size_t truths = 0;
  double last_norm = 0;
  const TruthSink sink = [&](UtcTime time, std::span<const Eigen::Vector3d> true_g) -> Status {
    EXPECT_EQ(to_unix_seconds(time), 1'428'588'240 + static_cast<std::int64_t>(truths / 30));
    truths += true_g.size();
    last_norm = true_g.front().norm();
    return {};
  };
  const auto report = write_recording(env.files, "a.gt3x", scenario, sink);
  ASSERT_OK(report);
  EXPECT_EQ(report->samples, 89U * 30);
  EXPECT_EQ(truths, 89U * 30);
  EXPECT_GT(last_norm, 0);
  ASSERT_OK(write_recording(env.files, "b.gt3x", scenario));
  EXPECT_EQ(*read_file(env.files, "a.gt3x"), *read_file(env.files, "b.gt3x"));
  Scenario other = scenario;
  other.seed = 8;
  ASSERT_OK(write_recording(env.files, "c.gt3x", other));
  EXPECT_NE(*read_file(env.files, "a.gt3x"), *read_file(env.files, "c.gt3x"));
}

TEST(Scenario, ATruthThatCannotBeWrittenStopsTheRecording) {
  const Scenario scenario = *parse_scenario(R"({"motions": [{"kind": "still"}]})");
  MemoryEnv env;
  const auto report = write_recording(
      env.files, "a.gt3x", scenario, [](UtcTime, std::span<const Eigen::Vector3d>) -> Status {
        return fail(ErrorCode::io, "full", "truth", "free some space");
      });
  EXPECT_FAILS(report, ErrorCode::io);
  EXPECT_FALSE(env.files.info("a.gt3x"));
}

}  // namespace
}  // namespace sixpoint::sim
