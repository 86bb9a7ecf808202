#include "device/unit.h"

#include <string>

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::device {
namespace {

// A unit that says who it is, and nothing else.
class NameOnly final : public Unit {
 public:
  explicit NameOnly(bool offers_recordings) {
    abilities_.offers_recordings = offers_recordings;
    identity_.serial = "MOS2A1";
  }
  UnitAbilities abilities() const override { return abilities_; }
  const Identity& identity() const override { return identity_; }
  Clock& clock() override { return memory_.clock; }
  const std::string& address() const override { return address_; }
  Result<Identity> identify() override { return identity_; }
  Status reconnect(std::chrono::nanoseconds, const std::function<Status()>&) override { return {}; }
  void cancel() override {}

 private:
  UnitAbilities abilities_{};
  Identity identity_;
  MemoryEnv memory_;
  std::string address_ = "drive:/media/unit";
};

// Oracle: unit.h: what a unit does not have fails with `usage`, names the unit and changes nothing.
TEST(Unit, WhatAUnitDoesNotHaveIsAUsageError) {
  NameOnly unit(true);
  MemoryEnv memory;
  const CalibrationPage page{};
  EXPECT_FAILS(unit.read_calibration(), ErrorCode::usage);
  EXPECT_FAILS(unit.write_calibration(page), ErrorCode::usage);
  EXPECT_FAILS(unit.filter(), ErrorCode::usage);
  EXPECT_FAILS(unit.set_filter(FilterConfiguration::current), ErrorCode::usage);
  EXPECT_FAILS(unit.start_stream(100), ErrorCode::usage);
  EXPECT_FAILS(unit.next_samples(std::chrono::seconds(1)), ErrorCode::usage);
  EXPECT_FAILS(unit.stop_stream(), ErrorCode::usage);
  EXPECT_FAILS(unit.start_recording(100, from_unix_seconds(0)), ErrorCode::usage);
  EXPECT_FAILS(unit.stop_recording(), ErrorCode::usage);
  EXPECT_FAILS(unit.recordings(), ErrorCode::usage);
  EXPECT_FAILS(unit.download({}, memory.files, "x.gt3x"), ErrorCode::usage);
  EXPECT_TRUE(memory.files.list(".")->empty());
  EXPECT_EQ(unit.start_stream(100).error().where, "drive:/media/unit");
  EXPECT_EQ(unit.stream_statistics().samples, 0U);
  EXPECT_EQ(unit.jig(), nullptr) << "mostly none is part of the device";
}

// A unit with recordings can still be calibrated, by a file: the hint says how.
TEST(Unit, TheHintSaysWhatTheUnitCanDoInstead) {
  EXPECT_EQ(NameOnly(true).start_stream(100).error().hint,
            "calibrate it by a file: 'sixpoint capture --device ADDRESS'");
  EXPECT_EQ(NameOnly(false).start_stream(100).error().hint, "docs/devices lists what it can do");
}

}  // namespace
}  // namespace sixpoint::device
