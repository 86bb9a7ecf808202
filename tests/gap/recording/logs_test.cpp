// Logs of a few rows, written here; what the reader makes of them is worked out by hand.
#include "gap/recording/logs.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "shared_data.h"

namespace sixpoint::gap {
namespace {

// Three segments of ten seconds at 100 Hz and 23 C, at 100, 200 and 300 s.
Bundle three_segments() {
  Bundle bundle;
  for (std::size_t i = 0; i < 3; ++i) {
    Segment segment;
    segment.first_sample = 1000 * i;
    segment.samples = 1000;
    segment.host_start_s = 100.0 * static_cast<double>(i + 1);
    segment.temperature_start_c = segment.temperature_end_c = 23;
    bundle.segments.push_back(segment);
  }
  bundle.samples.resize(3000);
  return bundle;
}

using Reader = void (*)(FileSystem&, const std::string&, Bundle&);

Bundle with_log(Reader reader, const std::string& text) {
  MemoryEnv memory;
  EXPECT_OK(write_file(memory.files, "log.csv", text));
  Bundle bundle = three_segments();
  reader(memory.files, "log.csv", bundle);
  return bundle;
}
Bundle with_temperature(const std::string& rows) {
  return with_log(read_temperature, "host_time_s,temperature_c\n" + rows);
}
Bundle with_clock(const std::string& rows) {
  return with_log(read_host_clock, "sample_index,host_time_s\n" + rows);
}

// A stamp each second, `late_s` after the protocol's time.
Bundle stamped(double late_s, std::size_t segments = 3) {
  Bundle bundle = three_segments();
  for (std::size_t i = 0; i < segments; ++i) {
    for (std::size_t n = 0; n < 10; ++n) {
      bundle.host_clock.sample_index.push_back(1000 * i + 100 * n);
      bundle.host_clock.host_time_s.push_back(bundle.segments[i].host_start_s +
                                              static_cast<double>(n) + late_s);
    }
  }
  return bundle;
}

// A log from `first_s` to `last_s`, a row each second.
Bundle logged(double first_s, double last_s, double temperature_c) {
  Bundle bundle = three_segments();
  for (double t = first_s; t <= last_s; t += 1) {
    bundle.temperature.host_time_s.push_back(t);
    bundle.temperature.temperature_c.push_back(temperature_c);
  }
  return bundle;
}

void expect_one_loss(const Bundle& bundle, const std::string& words) {
  ASSERT_EQ(bundle.losses.size(), 1U);
  EXPECT_NE(bundle.losses[0].find(words), std::string::npos) << bundle.losses[0];
}

TEST(Logs, MissingLogIsALossAndNoError) {
  MemoryEnv memory;
  Bundle bundle = three_segments();
  read_temperature(memory.files, "temperature.csv", bundle);
  expect_one_loss(bundle, "temperature.csv is missing or empty");
  bundle.losses.clear();
  read_host_clock(memory.files, "host_clock.csv", bundle);
  expect_one_loss(bundle, "host_clock.csv is missing or empty");
  bundle.losses.clear();
  check_logs(bundle);
  EXPECT_TRUE(bundle.losses.empty()) << "said already: " << bundle.losses.front();
}

TEST(Logs, OneRowIsNoLog) {
  const Bundle temperature = with_temperature("1,23\n");
  EXPECT_TRUE(temperature.temperature.empty());
  expect_one_loss(temperature, "missing or empty");
  const Bundle one_time = with_temperature("1,23\n1,24\n");
  EXPECT_TRUE(one_time.temperature.empty()) << "two readings of one moment";
  const Bundle clock = with_clock("0,100\n");
  EXPECT_TRUE(clock.host_clock.empty());
  expect_one_loss(clock, "missing or empty");
}

TEST(Logs, LineBreaksOfBothKindsAndALastLineWithoutOneAreRead) {
  const Bundle bundle = with_temperature("1,20\r\n2,22.5\r\n\r\n3,25");
  EXPECT_EQ(bundle.temperature.host_time_s, (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(bundle.temperature.temperature_c, (std::vector<double>{20, 22.5, 25}));
  EXPECT_TRUE(bundle.losses.empty());
}

// The mean is over seconds, not over rows: a log that pauses between two temperatures does not mix
// them.
TEST(Logs, AMeanOfReadingsEndsAtAPause) {
  std::string rows;
  for (int t = 0; t < 40; ++t) {
    rows += fmt::format("{},{}\n{},{}\n", t, 12 + (t % 2 == 0 ? 0.1 : -0.1), t + 100, 40);
  }
  const Bundle bundle = with_temperature(rows);
  ASSERT_EQ(bundle.temperature.temperature_c.size(), 80U);
  for (std::size_t i = 0; i < 80; ++i) {
    EXPECT_NEAR(bundle.temperature.temperature_c[i], i < 40 ? 12 : 40, 0.11) << i;
  }
  EXPECT_NEAR(bundle.temperature.temperature_c[20], 12, 0.1 / 31 + 1e-9) << "of 31 rows";
  const Bundle sparse = with_temperature("0,10\n60,20\n120,15\n180,15\n");
  EXPECT_EQ(sparse.temperature.temperature_c, (std::vector<double>{10, 20, 15, 15}));
}

TEST(Logs, LinesWithoutNumbersAreCountedAndLeftOut) {
  const Bundle bundle = with_temperature("1,20\nabc\n2,\n3;20\nnan,20\n4,inf\n5,20\n");
  EXPECT_EQ(bundle.temperature.host_time_s, (std::vector<double>{1, 5}));
  expect_one_loss(bundle, "temperature.csv: 5 lines hold no reading of this recording");
}

TEST(Logs, NumbersThatAreNoTemperatureAreLeftOut) {
  const Bundle bundle = with_temperature("1,20\n2,201\n3,-9999\n4,200\n");
  EXPECT_EQ(bundle.temperature.host_time_s, (std::vector<double>{1, 4}));
  expect_one_loss(bundle, "temperature.csv: 2 lines hold no reading of this recording");
}

// The recording has 3,000 samples.
TEST(Logs, LinesThatStampNoSampleAreCountedAndLeftOut) {
  const Bundle bundle = with_clock("0,100\n-1,101\n0.5,101\n3000,130\nabc\n2999,129\n");
  EXPECT_EQ(bundle.host_clock.sample_index, (std::vector<std::size_t>{0, 2999}));
  expect_one_loss(bundle, "host_clock.csv: 4 lines hold no reading of this recording");
}

TEST(Logs, RowsOutOfOrderAreSorted) {
  const Bundle bundle = with_temperature("3,30\n1,10\n2,20\n");
  EXPECT_EQ(bundle.temperature.host_time_s, (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(bundle.temperature.temperature_c, (std::vector<double>{10, 20, 30}));
  const Bundle clock = with_clock("200,102\n0,100\n100,101\n");
  EXPECT_EQ(clock.host_clock.sample_index, (std::vector<std::size_t>{0, 100, 200}));
  EXPECT_EQ(clock.host_clock.host_time_s, (std::vector<double>{100, 101, 102}));
}

// A symmetric mean leaves a straight line as it is, up to its ends; noise of one row's reading
// becomes a thirty-first; a step becomes the line through its middle.
TEST(Logs, TemperatureIsSmoothedOverHalfAMinuteWithoutDelay) {
  std::string line;
  std::string spike;
  std::string step;
  for (int i = 0; i < 101; ++i) {
    line += fmt::format("{},{}\n", i, 20 + 0.1 * i);
    spike += fmt::format("{},{}\n", i, i == 50 ? 23.1 : 20.0);
    step += fmt::format("{},{}\n", i, i < 50 ? 20 : i == 50 ? 25 : 30);
  }
  const Bundle straight = with_temperature(line);
  const Bundle spiked = with_temperature(spike);
  const Bundle stepped = with_temperature(step);
  ASSERT_EQ(straight.temperature.temperature_c.size(), 101U);
  for (std::size_t i = 0; i < 101; ++i) {
    const double t = static_cast<double>(i);
    EXPECT_NEAR(straight.temperature.temperature_c[i], 20 + 0.1 * t, 1e-9) << i;
    EXPECT_NEAR(spiked.temperature.temperature_c[i], i >= 35 && i <= 65 ? 20.1 : 20.0, 1e-9) << i;
    EXPECT_NEAR(stepped.temperature.temperature_c[i],
                25 + 10 * std::clamp((t - 50) / 31, -0.5, 0.5), 1e-9)
        << i;
  }
}

TEST(Logs, StampsOfNoSampleAreLeftOut) {
  const Bundle bundle = with_clock("-1,99\n0,100\n0.5,100\n2999,329\n3000,330\n1e30,400\n");
  EXPECT_EQ(bundle.host_clock.sample_index, (std::vector<std::size_t>{0, 2999}));
}

TEST(Logs, ClockOfTheProtocolsTimesIsKept) {
  for (const double late_s : {0.0, 0.4, -0.4}) {
    Bundle bundle = stamped(late_s);
    check_logs(bundle);
    EXPECT_EQ(bundle.host_clock.sample_index.size(), 30U) << late_s;
    EXPECT_TRUE(bundle.losses.empty());
  }
}

// A clock error of 0.5 % and a hundredth of all samples lost make 1.5 s in 100 s.
TEST(Logs, ClockErrorAndLostSamplesAreNoForeignClock) {
  Bundle bundle = three_segments();
  bundle.segments.resize(1);
  bundle.segments[0].samples = 10'000;
  for (std::size_t t = 0; t < 100; ++t) {
    bundle.host_clock.sample_index.push_back(100 * t);
    bundle.host_clock.host_time_s.push_back(100 + 1.015 * static_cast<double>(t));
  }
  check_logs(bundle);
  EXPECT_EQ(bundle.host_clock.sample_index.size(), 100U);
  EXPECT_TRUE(bundle.losses.empty());
}

TEST(Logs, ClockOfOtherTimesIsLeftOut) {
  for (const double late_s : {1.0, -1.0, 5000.0}) {
    Bundle bundle = stamped(late_s);
    check_logs(bundle);
    EXPECT_TRUE(bundle.host_clock.empty()) << late_s;
    expect_one_loss(bundle, "contradicts the protocol's times (30 of 30 stamps)");
  }
}

TEST(Logs, HalfOfTheStampsMayBeWrongNotMore) {
  Bundle half = stamped(0);
  for (std::size_t i = 0; i < 15; ++i) {
    half.host_clock.host_time_s[i] -= 20;
  }
  Bundle more = half;
  more.host_clock.host_time_s[15] -= 20;
  check_logs(half);
  EXPECT_FALSE(half.host_clock.empty());
  check_logs(more);
  EXPECT_TRUE(more.host_clock.empty());
  expect_one_loss(more, "(16 of 30 stamps)");
}

TEST(Logs, SegmentsWithoutAStampAreCounted) {
  Bundle bundle = stamped(0, 1);
  check_logs(bundle);
  expect_one_loss(bundle, "no stamp in 2 of 3 segments");
  // The sample behind a segment's last is not of the segment.
  Bundle edge = stamped(0, 2);
  edge.segments[2].first_sample = 1900;
  edge.segments[2].samples = 0;
  check_logs(edge);
  expect_one_loss(edge, "no stamp in 1 of 3 segments");
}

// The segments last from 100 to 310 s; a minute more or less is nothing to a unit's temperature.
TEST(Logs, SegmentsThatTheTemperatureDoesNotCoverAreCounted) {
  Bundle whole = logged(160, 250, 23);
  check_logs(whole);
  EXPECT_TRUE(whole.losses.empty()) << whole.losses.front();
  Bundle late = logged(161, 400, 23);
  check_logs(late);
  expect_one_loss(late, "does not cover 1 of 3 segments");
  Bundle early = logged(0, 149, 23);
  check_logs(early);
  expect_one_loss(early, "does not cover 2 of 3 segments");
}

TEST(Logs, TemperatureFarFromTheCommandedIsALoss) {
  Bundle lagging = logged(0, 400, 42);
  check_logs(lagging);
  EXPECT_TRUE(lagging.losses.empty()) << "19 C: the unit lags behind the chamber";
  Bundle far = logged(0, 400, 44);
  check_logs(far);
  expect_one_loss(far, "more than 20 C from what was commanded in 3 of 3 segments");
  // Of a ramp from 23 to 65 C the middle is 44 C.
  Bundle ramp = logged(0, 400, 44);
  ramp.segments[0].temperature_end_c = 65;
  check_logs(ramp);
  expect_one_loss(ramp, "in 2 of 3 segments");
}

// Oracle: the lines of the file. The log says 23.0 C to a tenth at its start.
TEST(Logs, PracticeBundlesLogsAreReadWhole) {
  SIXPOINT_NEED_SHARED("gap/practice2/r11/temperature.csv");
  Bundle bundle = three_segments();
  bundle.samples.resize(1'000'000);
  read_temperature(posix_env().files, tests::shared_file("gap/practice2/r11/temperature.csv"),
                   bundle);
  read_host_clock(posix_env().files, tests::shared_file("gap/practice2/r11/host_clock.csv"),
                  bundle);
  EXPECT_TRUE(bundle.losses.empty());
  EXPECT_EQ(bundle.temperature.host_time_s.size(), 11'355U);
  EXPECT_EQ(bundle.temperature.host_time_s[1], 1.49);
  EXPECT_NEAR(bundle.temperature.temperature_c[20], 23, 0.1);
  EXPECT_EQ(bundle.host_clock.sample_index.size(), 4'485U);
  EXPECT_EQ(bundle.host_clock.host_time_s[2], 35.1771);
}

// The table of Bundle::temperature_at, a row each: up from 20 to 40 C in 100 s, 100 s there, down again. The log
// reads 1 C more; what it should say of the moments that it lacks is worked out by hand.
TEST(Temperature, AGapOfTheLogFollowsTheCommand) {
  Bundle bundle;
  const std::array<std::array<double, 2>, 3> commanded_c = {{{20, 40}, {40, 40}, {40, 20}}};
  for (std::size_t i = 0; i < commanded_c.size(); ++i) {
    Segment segment;
    segment.samples = 10000;
    segment.first_sample = 10000 * i;
    segment.host_start_s = 100.0 * static_cast<double>(i);
    segment.temperature_start_c = commanded_c[i][0];
    segment.temperature_end_c = commanded_c[i][1];
    bundle.segments.push_back(segment);
  }
  EXPECT_NEAR(bundle.temperature_at(50), 30, 1e-9) << "no log: as commanded";
  bundle.temperature = {{0, 60, 130, 250}, {21, 33, 41, 31}};
  EXPECT_NEAR(bundle.temperature_at(30), 27, 1e-9) << "a minute: on the line";
  EXPECT_NEAR(bundle.temperature_at(100), 41, 1e-9) << "the line has 37.6";
  EXPECT_NEAR(bundle.temperature_at(200), 41, 1e-9) << "the line has 35.2";
  EXPECT_NEAR(bundle.temperature_at(300), 21, 1e-9) << "behind the last reading";
  bundle.segments[2].temperature_start_c = 30;
  EXPECT_NEAR(bundle.temperature_at(200), 41 - 10 * 70.0 / 120, 1e-9) << "it jumps: on the line";
  EXPECT_NEAR(bundle.temperature_at(100), 41, 1e-9) << "it does not jump here";
  bundle.temperature = {{60, 130}, {33, 41}};
  EXPECT_NEAR(bundle.temperature_at(0), 21, 1e-9) << "before the first reading";
  EXPECT_NEAR(bundle.temperature_at(250), 41, 1e-9) << "behind a jump: the last reading";
}

}  // namespace
}  // namespace sixpoint::gap
