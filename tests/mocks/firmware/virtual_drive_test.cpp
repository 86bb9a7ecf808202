#include "mocks/firmware/virtual_drive.h"

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/log/samples.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::mocks {
namespace {

// All samples of a recording, in order.
std::vector<gt3x::Counts> samples_of(const Bytes& image) {
  MemoryEnv memory;
  EXPECT_OK(write_file(memory.files, "r.gt3x", as_text(image)));
  auto recording = gt3x::Recording::open(memory.files, "r.gt3x");
  auto log = recording->open_log();
  std::vector<gt3x::Counts> all;
  std::vector<gt3x::Counts> some;
  for (auto item = log->next(); item && *item; item = log->next()) {
    if ((*item)->record.is(gt3x::RecordType::activity)) {
      gt3x::unpack_activity((*item)->record.payload, some);
      all.insert(all.end(), some.begin(), some.end());
    }
  }
  return all;
}

VirtualDriveOptions drawn() {
  VirtualDriveOptions options;
  options.unit.truth = sim::draw_unit(7);
  return options;
}

// Oracle: the closed form of a stored count, 512 (raw - zero) / (positive - negative), with raw =
// zero + g times sensitivity of the sensor under `current`, which firmware 1.5.0 records. 0.6: two
// roundings, and noise and seating of a mean over 30 s.
TEST(VirtualDrive, LiesOnItsSidesOneAfterTheOther) {
  const VirtualDriveOptions options = drawn();
  const auto image = virtual_drive_recording(options);
  ASSERT_OK(image);
  const auto samples = samples_of(*image);
  constexpr std::size_t kSideSamples = 45 * 30;
  ASSERT_EQ(samples.size(), 6 * kSideSamples);
  const sim::UnitTruth& truth = options.unit.truth;
  const int up[6][3] = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
  for (std::size_t side = 0; side < 6; ++side) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      double sum = 0;
      for (std::size_t i = 10 * 30; i < 40 * 30; ++i) {  // the turn is over, the next not begun
        sum += samples[side * kSideSamples + i][axis];
      }
      const double raw =
          truth.current.zero_lsb[axis] + up[side][axis] * truth.current.sensitivity_lsb_per_g[axis];
      const double stored =
          512 * (raw - truth.constants.zero_lsb[axis]) /
          (truth.constants.positive_lsb[axis] - truth.constants.negative_lsb[axis]);
      EXPECT_NEAR(sum / (30 * 30), stored, 0.6) << "side " << side << " axis " << axis;
    }
  }
}

TEST(VirtualDrive, FewerSidesAreAShorterRecording) {
  VirtualDriveOptions options = drawn();
  options.sides = 2;
  options.side_s = 12;
  options.rate_hz = 50;
  const auto image = virtual_drive_recording(options);
  ASSERT_OK(image);
  EXPECT_EQ(samples_of(*image).size(), 2U * 12 * 50);
}

// docs/protocol.md: below 3300 mV nothing is recorded, nor at a rate that there is not.
TEST(VirtualDrive, AUnitThatRecordsNothingIsRefused) {
  VirtualDriveOptions empty = drawn();
  empty.unit.battery_mv = 3299;
  EXPECT_FAILS(virtual_drive_recording(empty), ErrorCode::usage);
  VirtualDriveOptions odd = drawn();
  odd.rate_hz = 31;
  EXPECT_FAILS(virtual_drive_recording(odd), ErrorCode::usage);
}

// A folder as the unit's volume shows it. Oracle: info.txt's own lines, and the byte 0x1E with
// which every record of a log begins (docs/recordings.md).
TEST(VirtualDrive, TheFolderHoldsWhatTheRecordingSays) {
  MemoryEnv memory;
  const VirtualDriveOptions options = drawn();
  ASSERT_OK(make_virtual_drive(memory.files, "media/UNIT", options));
  const auto names = memory.files.list("media/UNIT");
  ASSERT_OK(names);
  EXPECT_THAT(*names, testing::UnorderedElementsAre("info.txt", "log.bin"));
  const auto info = read_file(memory.files, "media/UNIT/info.txt");
  ASSERT_OK(info);
  EXPECT_THAT(std::string(info->begin(), info->end()),
              testing::AllOf(testing::HasSubstr("Serial Number: " + options.unit.truth.serial),
                             testing::HasSubstr("Sample Rate: 30")));
  const auto log = read_file(memory.files, "media/UNIT/log.bin");
  ASSERT_OK(log);
  ASSERT_FALSE(log->empty());
  EXPECT_EQ(log->front(), 0x1E);
}

}  // namespace
}  // namespace sixpoint::mocks
