#include "device/drive/drive_unit.h"

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/forwarding_files.h"
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

// The unit records on while it is copied, or another log.bin is put in its place.
TEST(DriveUnit, ALogThatChangesWhileItIsReadIsThrownAway) {
  DriveBench bench;
  const auto unit = *bench.registry->open("drive:usb", bench.memory.env);
  const RecordingInfo listed = unit->recordings()->front();
  const Bytes log = *read_file(bench.memory.files, "usb/log.bin");
  std::uint64_t reported = 0;
  ASSERT_OK(unit->download(listed, bench.memory.files, "r.gt3x",
                           [&](std::uint64_t bytes) { reported = bytes; }));
  EXPECT_EQ(reported, log.size());
  Bytes longer = log;
  longer.push_back(0);
  ASSERT_OK(write_file(bench.memory.files, "usb/log.bin", as_text(longer)));
  const Status changed = unit->download(listed, bench.memory.files, "s.gt3x");
  EXPECT_FAILS(changed, ErrorCode::bad_data);
  EXPECT_EQ(changed.error().what, "log.bin changed while it was read");
  EXPECT_FALSE(bench.memory.files.info("s.gt3x"));
}

// A disk on which no file gets its final name.
class NoNames final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Status rename(const std::string& /*from*/, const std::string& to) override { return named(to); }
  Status rename_new(const std::string& /*from*/, const std::string& to) override {
    return named(to);
  }

 private:
  static Status named(const std::string& to) {
    return fail(ErrorCode::cannot_create, "the file has its name", to, "check it before");
  }
};

// A program that is killed behind the check leaves no wrong recording under its name.
TEST(DriveUnit, ARecordingIsCheckedBeforeItHasItsName) {
  DriveBench bench;
  const auto unit = *bench.registry->open("drive:usb", bench.memory.env);
  RecordingInfo listed = unit->recordings()->front();
  NoNames files(bench.memory.files);
  EXPECT_FAILS(unit->download(listed, files, "r.gt3x"), ErrorCode::cannot_create);
  listed.sha256[0] ^= 1U;
  EXPECT_FAILS(unit->download(listed, files, "r.gt3x"), ErrorCode::bad_data);
}

// Oracle: unit.h, reconnect().
TEST(DriveUnit, ReconnectingWaitsUntilTheSameUnitIsMountedAgain) {
  DriveBench bench;
  auto& files = bench.memory.files;
  const auto unit = *bench.registry->open("drive:usb", bench.memory.env);
  EXPECT_OK(unit->reconnect(std::chrono::seconds(1))) << "it was not away";
  const Bytes info = *read_file(files, "usb/info.txt");
  ASSERT_OK(files.remove("usb/info.txt"));
  const auto began = unit->clock().elapsed();
  const Status away = unit->reconnect(std::chrono::seconds(5));
  EXPECT_FAILS(away, ErrorCode::device_unavailable);
  EXPECT_EQ(away.error().what, "the unit's folder did not come back");
  EXPECT_GE(unit->clock().elapsed() - began, std::chrono::seconds(5));
  const Status stopped = unit->reconnect(std::chrono::seconds(5), []() -> Status {
    return fail(ErrorCode::internal, "stopped", {}, "begin anew");
  });
  EXPECT_FAILS(stopped, ErrorCode::internal);
  int looks = 0;
  EXPECT_OK(unit->reconnect(std::chrono::seconds(5), [&]() -> Status {
    return ++looks == 3 ? write_file(files, "usb/info.txt", as_text(info)) : Status{};
  }));
  EXPECT_EQ(looks, 3);
  // Another unit ends the wait at once.
  ASSERT_OK(files.remove("usb/info.txt"));
  std::string other(as_text(info));
  const std::string serial = unit->identity().serial;
  other.replace(other.find(serial), serial.size(), "MOS2B99990001");
  ASSERT_OK(write_file(files, "usb/info.txt", other));
  const Status swapped = unit->reconnect(std::chrono::hours(1));
  EXPECT_FAILS(swapped, ErrorCode::device_unavailable);
  EXPECT_THAT(swapped.error().what, HasSubstr("is now MOS2B99990001"));
  EXPECT_EQ(unit->identity().serial, serial);
}

// info.txt comes from the unit: whatever stands in it, the identity is one that can be shown.
TEST(DriveUnit, WhatInfoSaysIsBroughtIntoItsLimits) {
  DriveBench bench;
  const auto identity_of = [&](const std::string& more) {
    EXPECT_OK(bench.memory.files.make_folders("drive"));
    EXPECT_OK(write_file(bench.memory.files, "drive/log.bin", ""));
    if (bench.memory.files.info("drive/info.txt")) {
      EXPECT_OK(bench.memory.files.remove("drive/info.txt"));
    }
    EXPECT_OK(write_file(bench.memory.files, "drive/info.txt",
                         "Serial Number: MOS2A00000007\r\n" + more));
    return (*bench.registry->open("drive:drive///", bench.memory.env))->identity();
  };
  const Identity bare = identity_of("");
  EXPECT_EQ(bare.serial, "MOS2A00000007");
  EXPECT_EQ(bare.firmware, "");
  EXPECT_EQ(bare.battery_mv, 0) << "takes no command that needs charge";
  EXPECT_EQ(bare.accel_scale_lsb_per_g, 256);
  const Identity odd = identity_of(
      "Firmware: 1.5 \x1b[2J\r\nDevice Type: wGT3X\xc3\xbf and so on and so on\r\n"
      "Battery Voltage: 99999\r\nAcceleration Scale: 1e9\r\n");
  EXPECT_EQ(odd.firmware, "1.5__[2J");
  EXPECT_EQ(odd.model, "wGT3X___and_");
  EXPECT_EQ(odd.battery_mv, 60'000);
  EXPECT_LE(odd.accel_scale_lsb_per_g, 65'535);
  EXPECT_GE(odd.accel_scale_lsb_per_g, 1);
  const Identity low = identity_of("Battery Voltage: -1\r\nAcceleration Scale: 0.1\r\n");
  EXPECT_EQ(low.battery_mv, 0);
  EXPECT_GE(low.accel_scale_lsb_per_g, 1);
}

TEST(DriveUnit, AFileOrAnEmptyInfoIsNoUnit) {
  DriveBench bench;
  const auto open = [&](const char* address) {
    return bench.registry->open(address, bench.memory.env);
  };
  EXPECT_FAILS(open("drive:usb/log.bin"), ErrorCode::no_input);
  EXPECT_EQ(open("drive:///").error().where, "/") << "the name of a folder is left";
  ASSERT_OK(bench.memory.files.make_folders("blank"));
  ASSERT_OK(write_file(bench.memory.files, "blank/log.bin", ""));
  ASSERT_OK(write_file(bench.memory.files, "blank/info.txt", ""));
  EXPECT_FAILS(open("drive:blank"), ErrorCode::bad_data);
  const auto unit = *open("drive:usb");
  ASSERT_OK(bench.memory.files.remove("usb/log.bin"));
  EXPECT_FAILS(unit->recordings(), ErrorCode::no_input);
}

}  // namespace
}  // namespace sixpoint::device
