// sixpoint compare by its contract; tests/repair/compare has the numbers.
#include <cmath>

#include <gmock/gmock.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x_made_log.h"
#include "run_command.h"

namespace sixpoint::cli {
namespace {

using gt3x::tests::kStart;
using tests::run_command;

// Ten minutes of a motion that swells and fades, by a unit whose clock is late by `late_s`. With
// `scale_percent` of the motion: 100 is the motion itself.
Bytes moved(std::uint32_t late_s, double scale_percent = 100) {
  Bytes log;
  gt3x::append_record(log, gt3x::RecordType::parameters, kStart - 70,
                      gt3x::encode_parameters(gt3x::tests::made_parameters()));
  for (std::uint32_t second = 0; second < 600; ++second) {
    std::vector<gt3x::Counts> samples(30);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double time_s = second + static_cast<double>(i) / 30;
      const double motion = std::sin(time_s / 7) * std::sin(time_s / 7) *
                            (std::sin(2.1 * time_s) + std::sin(5.3 * time_s + 1));
      samples[i] = {0, 0,
                    static_cast<std::int16_t>(std::lround(256 + 0.4 * scale_percent * motion))};
    }
    Bytes payload;
    gt3x::append_activity(payload, samples);
    gt3x::append_record(log, gt3x::RecordType::activity, kStart + second + late_s, payload);
  }
  return log;
}

struct Units {
  Units() {
    EXPECT_OK(gt3x::tests::put_recording(memory.files, "a.gt3x", moved(0)));
    EXPECT_OK(gt3x::tests::put_recording(memory.files, "late.gt3x", moved(2)));
    EXPECT_OK(gt3x::tests::put_recording(memory.files, "weak.gt3x", moved(0, 50)));
    EXPECT_OK(gt3x::tests::put_recording(memory.files, "still.gt3x", moved(0, 0)));
  }
  MemoryEnv memory;
};

// The same samples two seconds later: that lag, and no difference. A sample is 33 ms.
TEST(Compare, FindsTheLagOfTheSameMotion) {
  Units units;
  const auto answer = run_command(units.memory.env,
                                  {"compare", "a.gt3x", "late.gt3x", "--json", "--html", "p.html"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const auto json = answer.json();
  EXPECT_EQ(json["schema"], "sixpoint/compare/1");
  ASSERT_EQ(json["pairs"].size(), 1U);
  EXPECT_NEAR(json["pairs"][0]["lag_s"].get<double>(), 2, 0.002);
  EXPECT_NEAR(json["pairs"][0]["rms_mg"].get<double>(), 0, 1);
  EXPECT_NEAR(json["pairs"][0]["envelope_error_mg"]["p95"].get<double>(), 0, 1);
  const auto page = read_file(units.memory.files, "p.html");
  ASSERT_OK(page);
  EXPECT_THAT(std::string(page->begin(), page->end()), testing::HasSubstr("<svg"));
}

// The middle of the lively minutes, by the clock of the first recording: no zone where none is known
// (before: a Z), the wearer's time and its offset where the clock is UTC and the offset is known.
TEST(Compare, TimesAreByTheClockOfTheFirstRecording) {
  Units units;
  ASSERT_OK(gt3x::tests::put_recording(
      units.memory.files, "utc.gt3x", moved(0),
      gt3x::tests::made_info() + "Download Software: CentrePoint\r\nTimeZone: -05:00:00\r\n"));
  const auto lag_at = [&](const std::string& first) {
    const auto json =
        run_command(units.memory.env, {"compare", first, "late.gt3x", "--json"}).json();
    return json["pairs"][0]["lag_at"].get<std::string>();
  };
  const std::string unknown = lag_at("a.gt3x");
  EXPECT_THAT(unknown, testing::MatchesRegex("2015-04-09T14:[0-9:.]+"));
  const std::string utc = lag_at("utc.gt3x");
  EXPECT_THAT(utc, testing::MatchesRegex("2015-04-09T09:[0-9:.]+-05:00"));
  EXPECT_EQ(utc.substr(13, unknown.size() - 13), unknown.substr(13));
}

TEST(Compare, ThreeRecordingsAreThreePairs) {
  Units units;
  const auto answer =
      run_command(units.memory.env, {"compare", "a.gt3x", "late.gt3x", "weak.gt3x", "--json"});
  const auto json = answer.json();
  ASSERT_EQ(json["pairs"].size(), 3U);
  EXPECT_EQ(json["pairs"][1]["a"], "a.gt3x");
  EXPECT_EQ(json["pairs"][1]["b"], "weak.gt3x");
  EXPECT_NEAR(json["pairs"][1]["lag_s"].get<double>(), 0, 0.002);
  EXPECT_GT(json["pairs"][1]["envelope_error_mg"]["p95"].get<double>(), 20) << "half the motion";
}

// A unit that lay still says nothing about time: inconclusive, 2.
TEST(Compare, WithoutMotionItIsInconclusive) {
  Units units;
  const auto answer = run_command(units.memory.env, {"compare", "a.gt3x", "still.gt3x", "--json"});
  EXPECT_EQ(answer.exit_code, 2);
  EXPECT_EQ(answer.json()["pairs"][0]["aligned"], false);
}

// "Clocks ... may differ" by --max-lag and no more.
TEST(Compare, RefusesByTheContractsCodes) {
  Units units;
  const auto code = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "compare");
    return run_command(units.memory.env, arguments).exit_code;
  };
  EXPECT_EQ(code({"a.gt3x"}), 64) << "with what?";
  EXPECT_EQ(code({"a.gt3x", "a.gt3x", "a.gt3x", "a.gt3x"}), 64);
  EXPECT_EQ(code({"a.gt3x", "none.gt3x"}), 66);
  EXPECT_EQ(code({"a.gt3x", "a.gt3x", "--max-lag", "-1"}), 64);
  EXPECT_NE(run_command(units.memory.env,
                        {"compare", "a.gt3x", "late.gt3x", "--max-lag", "0.5", "--json"})
                .json()["pairs"][0]["lag_s"],
            2.0);
}

}  // namespace
}  // namespace sixpoint::cli
