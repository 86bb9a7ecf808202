#include "device/drive/drive_unit.h"

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "failing_files.h"
#include "gt3x/recording.h"
#include "mocks/firmware/virtual_drive.h"

namespace sixpoint::device {
namespace {

using testing::HasSubstr;

struct DriveBench {
  DriveBench() {
    options.unit.truth = sim::draw_unit(7);
    EXPECT_OK(mocks::make_virtual_drive(memory.files, "usb", options));
    registry.emplace(TransportRegistry(),
                     [](Link link) { return WireUnit::open(std::move(link)); });
    register_drive(*registry);
  }
  MemoryEnv memory;
  mocks::VirtualDriveOptions options;
  std::optional<UnitRegistry> registry;
};

TEST(DriveUnit, SaysWhoItIsAndHandsOutItsRecording) {
  DriveBench bench;
  const auto unit = bench.registry->open("drive:usb/", bench.memory.env);
  ASSERT_OK(unit);
  EXPECT_EQ((*unit)->identity().serial, bench.options.unit.truth.serial);
  EXPECT_EQ((*unit)->identity().firmware, bench.options.unit.truth.firmware);
  EXPECT_FALSE((*unit)->abilities().streams);
  EXPECT_TRUE((*unit)->abilities().offers_recordings);
  const auto recordings = (*unit)->recordings();
  ASSERT_OK(recordings);
  ASSERT_EQ(recordings->size(), 1U);
  ASSERT_OK((*unit)->download(recordings->front(), bench.memory.files, "r.gt3x"));
  auto recording = gt3x::Recording::open(bench.memory.files, "r.gt3x");
  ASSERT_OK(recording);
  const auto log = recording->open_entry("log.bin");
  ASSERT_OK(log);
  EXPECT_EQ(*gt3x::read_all(**log, 1U << 30U), *read_file(bench.memory.files, "usb/log.bin"))
      << "byte for byte";
  EXPECT_FAILS((*unit)->download(recordings->front(), bench.memory.files, "r.gt3x"),
               ErrorCode::cannot_create);
}

TEST(DriveUnit, WhatItCannotDoIsUsage) {
  DriveBench bench;
  const auto unit = *bench.registry->open("drive:usb", bench.memory.env);
  EXPECT_FAILS(unit->start_stream(100), ErrorCode::usage);
  EXPECT_FAILS(unit->read_calibration(), ErrorCode::usage);
  EXPECT_FAILS(unit->write_calibration({}), ErrorCode::usage);
  EXPECT_FAILS(unit->set_filter(FilterConfiguration::current), ErrorCode::usage);
  EXPECT_FAILS(unit->start_recording(30, {}), ErrorCode::usage);
}

TEST(DriveUnit, RefusesWhatIsNoUnit) {
  DriveBench bench;
  const auto open = [&](const char* address) {
    return bench.registry->open(address, bench.memory.env);
  };
  EXPECT_FAILS(open("drive:nowhere"), ErrorCode::no_input);
  ASSERT_OK(bench.memory.files.make_folders("empty"));
  EXPECT_FAILS(open("drive:empty"), ErrorCode::bad_data);
  ASSERT_OK(write_file(bench.memory.files, "empty/info.txt", "Serial Number: \x01\x02\r\n"));
  ASSERT_OK(write_file(bench.memory.files, "empty/log.bin", ""));
  EXPECT_FAILS(open("drive:empty"), ErrorCode::bad_data);
}

TEST(DriveUnit, AnotherUnitInItsPlaceIsNoticed) {
  DriveBench bench;
  const auto unit = *bench.registry->open("drive:usb", bench.memory.env);
  const auto recordings = *unit->recordings();
  DriveBench other;
  sim::GivenProperties given;
  given.serial = "MOS2B99990001";
  other.options.unit.truth = sim::draw_unit(8, given);
  ASSERT_OK(mocks::make_virtual_drive(bench.memory.files, "usb", other.options));
  const auto copied = unit->download(recordings.front(), bench.memory.files, "r.gt3x");
  EXPECT_FAILS(copied, ErrorCode::device_unavailable);
  EXPECT_THAT(copied.error().what, HasSubstr("is now MOS2B99990001"));
  EXPECT_FALSE(bench.memory.files.info("r.gt3x")) << "nothing wrong is kept";
}

// Whatever call of the disk fails: it is said, no wrong recording is there, and it succeeds again.
TEST(DriveUnit, EachCallOfTheDiskMayFail) {
  DriveBench bench;
  tests::FailingFiles files(bench.memory.files);
  Env env{bench.memory.clock, files};
  const auto each_call_fails = [&](const char* name, auto operation) {
    SCOPED_TRACE(name);
    for (std::size_t call = 0;; ++call) {
      files.fail_at(call);
      const auto result = operation();
      files.stop_failing();
      if (!files.has_failed()) {
        EXPECT_OK(result);
        EXPECT_GT(call, 0U);
        return;
      }
      EXPECT_FAILS(result, ErrorCode::io);
    }
  };
  each_call_fails("open", [&] { return DriveUnit::open("usb", env); });
  const auto unit = *DriveUnit::open("usb", env);
  each_call_fails("identify", [&] { return unit->identify(); });
  each_call_fails("recordings", [&] { return unit->recordings(); });
  const RecordingInfo recording = unit->recordings()->front();
  int tries = 0;
  each_call_fails("download", [&] {
    const std::string path = "r" + std::to_string(++tries) + ".gt3x";
    const Status result = unit->download(recording, bench.memory.files, path);
    if (!result) {
      EXPECT_FALSE(bench.memory.files.info(path)) << path;
    }
    return result;
  });
  each_call_fails("download, its own disk", [&] {
    return unit->download(recording, files, "s" + std::to_string(++tries) + ".gt3x");
  });
}

}  // namespace
}  // namespace sixpoint::device
