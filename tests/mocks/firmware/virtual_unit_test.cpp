#include "mocks/firmware/virtual_unit.h"

#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/log/record.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"
#include "mocks/made_bench.h"

namespace sixpoint::mocks {
namespace {

using device::Pose;
using sim::FilterConfiguration;

// Oracle: closed form of the sensor under the filter that is set, in all six poses.
TEST(VirtualUnit, TheJigTurnsItAndTheFilterChangesIt) {
  for (const auto filter : {FilterConfiguration::legacy, FilterConfiguration::current}) {
    Bench bench;
    ASSERT_OK(bench.unit->set_filter(filter));
    const sim::SensorTruth& truth = bench.plugged->unit.truth().sensor(filter);
    for (const Pose pose : device::kPoses) {
      ASSERT_OK(bench.jig->go_to(pose));
      EXPECT_FALSE(bench.jig->position()->pose.has_value()) << "still turning";
      bench.clock->sleep(std::chrono::seconds(2));
      EXPECT_EQ(bench.jig->position()->pose, pose);
      ASSERT_OK(bench.unit->start_stream(100));
      const auto mean = mean_of_stream(bench, 100);
      ASSERT_OK(bench.unit->stop_stream());
      const auto direction = device::direction_of(pose);
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        // Noise of 600 samples 0.06 LSB, seating 0.05 LSB per 0.01 degree.
        EXPECT_NEAR(mean[axis],
                    truth.zero_lsb[axis] + direction[axis] * truth.sensitivity_lsb_per_g[axis],
                    0.35)
            << device::to_string(pose);
      }
    }
  }
}

// What firmware 1.5.0 records of an old unit is the sensor under `current`, scaled with constants
// of `legacy`; 1.8.0 records under `legacy`. Oracle: closed form.
TEST(VirtualUnit, RecordsUnderTheFirmwaresOwnFilter) {
  for (const char* firmware : {"1.5.0", "1.8.0"}) {
    Bench bench(firmware);
    ASSERT_OK(bench.unit->set_filter(FilterConfiguration::legacy));  // must not matter
    ASSERT_OK(bench.unit->start_recording(30, from_unix_seconds(1'428'588'240)));
    bench.clock->sleep(std::chrono::seconds(60));
    ASSERT_OK(bench.unit->stop_recording());
    const auto list = bench.unit->recordings();
    ASSERT_OK(list);
    MemoryEnv env;
    ASSERT_OK(bench.unit->download(list->front(), env.files, "x.gt3x"));
    auto recording = gt3x::Recording::open(env.files, "x.gt3x");
    ASSERT_OK(recording);
    EXPECT_EQ(recording->info().serial(), bench.plugged->unit.truth().serial);
    EXPECT_EQ(recording->info().firmware(), firmware);
    auto log = recording->open_log();
    ASSERT_OK(log);
    std::vector<gt3x::Counts> samples;
    PerAxis<double> sum{};
    double count = 0;
    for (;;) {
      const auto item = log->next();
      ASSERT_OK(item);
      if (!*item) {
        break;
      }
      if ((*item)->record.is(gt3x::RecordType::activity)) {
        EXPECT_TRUE((*item)->record.checksum_ok);
        gt3x::unpack_activity((*item)->record.payload, samples);
        for (const auto& sample : samples) {
          for (std::size_t axis = 0; axis < kAxes; ++axis) {
            sum[axis] += sample[axis];
          }
          ++count;
        }
      }
    }
    EXPECT_EQ(count, 60 * 30);
    const auto& unit = bench.plugged->unit.truth();
    const auto& truth = firmware[2] == '5' ? unit.current : unit.legacy;
    const double up[] = {0, 0, 1};
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double raw = truth.zero_lsb[axis] + up[axis] * truth.sensitivity_lsb_per_g[axis];
      const double stored = 256.0 * 2 * (raw - unit.constants.zero_lsb[axis]) /
                            (unit.constants.positive_lsb[axis] - unit.constants.negative_lsb[axis]);
      // Rounding twice, to raw and to stored counts, leaves up to half a count that noise of
      // this size does not average out; the rest is noise and seating.
      EXPECT_NEAR(sum[axis] / count, stored, 0.6) << firmware << " axis " << axis;
    }
  }
}

// docs/virtual.md, battery_mv: in V, as real files have it.
TEST(VirtualUnit, ARecordingNamesTheBatteryOfTheUnit) {
  for (const auto& [battery_mv, battery_v] : {std::pair<std::uint16_t, double>{3400, 3.40},
                                              std::pair<std::uint16_t, double>{4100, 4.10}}) {
    Bench bench;
    bench.plugged->unit.set_battery_mv(battery_mv);
    ASSERT_OK(bench.unit->start_recording(30, from_unix_seconds(1'428'588'240)));
    bench.clock->sleep(std::chrono::seconds(3));
    ASSERT_OK(bench.unit->stop_recording());
    MemoryFiles files;
    ASSERT_OK(bench.unit->download(bench.unit->recordings()->front(), files, "x.gt3x"));
    const auto recording = gt3x::Recording::open(files, "x.gt3x");
    ASSERT_OK(recording);
    EXPECT_EQ(recording->info().battery_v(), battery_v);
  }
}

TEST(VirtualUnit, FullFlashEndsTheRecording) {
  VirtualUnitOptions options;
  options.truth = sim::draw_unit(7);
  options.flash_bytes = 200'000;
  const auto clock = std::make_shared<ManualClock>();
  const auto plugged = std::make_shared<PluggedUnit>(options, clock);
  auto unit = *device::WireUnit::open(link_to(plugged, false));
  ASSERT_OK(unit->start_recording(100, from_unix_seconds(0)));
  clock->sleep(std::chrono::hours(10));
  ASSERT_OK(unit->stop_recording());
  EXPECT_LE(unit->recordings()->front().bytes, 200'000U);
  EXPECT_GT(unit->recordings()->front().bytes, 190'000U);
  EXPECT_FAILS(unit->start_recording(100, from_unix_seconds(0)), ErrorCode::io);
}

TEST(VirtualUnit, PowerLossForgetsWhatIsInRam) {
  Bench bench;
  ASSERT_OK(bench.unit->set_filter(FilterConfiguration::legacy));
  ASSERT_OK(bench.unit->start_stream(100));
  bench.plugged->unit.cut_power(bench.clock->elapsed());
  EXPECT_FALSE((*bench.unit->next_samples(std::chrono::seconds(1))).has_value());
  EXPECT_FAILS(bench.unit->filter(), ErrorCode::device_unavailable);
  bench.plugged->unit.restore_power(bench.clock->elapsed());
  const auto filter = bench.unit->filter();
  ASSERT_OK(filter);
  EXPECT_EQ(filter->stream, FilterConfiguration::current) << "the firmware's own choice again";
}

}  // namespace
}  // namespace sixpoint::mocks
