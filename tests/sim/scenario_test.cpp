#include "sim/scenario.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "sim/made_scenario.h"
#include "sim/recording.h"

namespace sixpoint::sim {
namespace {

TEST(Scenario, SameScenarioSameBytesAndTruth) {
  const Scenario scenario = *parse_scenario(tests::kWholeScenario);
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

// Oracle: the times added up by hand: three motions of 20, 5 and 60 s with two turns of 2 s between
// them. Free-living motion counts as the pose before it.
TEST(Scenario, PlacementsAreWhereTheMotionsBegin) {
  const Scenario scenario = *parse_scenario(tests::kWholeScenario);
  const auto placements = scenario.placements();
  ASSERT_EQ(placements.size(), 3U);
  EXPECT_EQ(placements[0].start_s, 0);
  EXPECT_EQ(placements[1].start_s, 22);
  EXPECT_EQ(placements[2].start_s, 29);
  EXPECT_TRUE(placements[0].anew) << "the unit was laid down before the recording began";
  EXPECT_EQ(placements[0].previous, placements[0].rotation);
  EXPECT_EQ(placements[1].previous, placements[0].rotation);
  EXPECT_EQ(placements[2].rotation, placements[1].rotation) << "free-living";
  EXPECT_FALSE(placements[2].anew);
  EXPECT_FALSE(placements[2].contiguous) << "two seconds lie between";
}

TEST(Scenario, WithoutATurnTheSamePoseGoesOn) {
  const Scenario scenario = *parse_scenario(
      R"({"turn_s": 0, "motions": [{"kind": "still", "duration_s": 10, "pose": "+x"},
          {"kind": "shaker", "duration_s": 10, "pose": "+x"},
          {"kind": "still", "duration_s": 10, "pose": "-x"}]})");
  const auto placements = scenario.placements();
  ASSERT_EQ(placements.size(), 3U);
  EXPECT_EQ(placements[1].start_s, 10);
  EXPECT_TRUE(placements[1].contiguous);
  EXPECT_FALSE(placements[1].anew);
  EXPECT_FALSE(placements[2].contiguous);
  EXPECT_TRUE(placements[2].anew);
}

// Oracle: sample numbers by hand at 30 Hz; only the unit at rest rests, not the one that is shaken.
TEST(Scenario, ThePlanCountsWholeSecondsAndTheRests) {
  const RecordingPlan plan = parse_scenario(tests::kWholeScenario)->plan();
  EXPECT_EQ(plan.rate_hz, 30);
  EXPECT_EQ(plan.samples, 89U * 30);
  ASSERT_EQ(plan.rests.size(), 1U);
  EXPECT_EQ(plan.rests[0].first_sample, 0U);
  EXPECT_EQ(plan.rests[0].samples, 600U);
  const RecordingPlan two =
      parse_scenario(R"({"rate_hz": 100, "motions": [{"kind": "still", "duration_s": 1.5},
          {"kind": "still", "duration_s": 3, "pose": "+x"}]})")
          ->plan();
  EXPECT_EQ(two.samples, 600U) << "6.5 s, cut to whole seconds";
  ASSERT_EQ(two.rests.size(), 2U);
  EXPECT_EQ(two.rests[1].first_sample, 350U);
  EXPECT_EQ(two.rests[1].samples, 300U);
}

TEST(Scenario, TheFilterInForceIsTheGivenOneElseTheFirmwares) {
  const char* const kUnit = R"("unit": {"serial": "MOS2A45130007", "calibrated": "2013-11-12",
      "firmware": )";
  const auto filter_of = [&](const std::string& firmware, const std::string& given) {
    const auto scenario = parse_scenario(
        fmt::format(R"({{"motions": [{{"kind": "still"}}], {}"{}"}}{}}})", kUnit, firmware, given));
    EXPECT_OK(scenario);
    return scenario->filter_in_force();
  };
  // The paper's table: firmware 1.4.0 to 1.7.0 sets `current` on units of 2013, 1.8.0 does not.
  EXPECT_EQ(filter_of("1.5.0", ""), FilterConfiguration::current);
  EXPECT_EQ(filter_of("1.8.0", ""), FilterConfiguration::legacy);
  EXPECT_EQ(filter_of("1.5.0", R"(, "filter": "legacy")"), FilterConfiguration::legacy);
  EXPECT_EQ(filter_of("1.8.0", R"(, "filter": "current")"), FilterConfiguration::current);
}

}  // namespace
}  // namespace sixpoint::sim
