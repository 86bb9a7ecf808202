// A unit whose link breaks at any call: each operation says so or is complete, and a link that is
// opened anew finds the unit as it was or as it was asked to be.
#include <functional>

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "device/made_links.h"
#include "device/wire/made_bench.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "failing_files.h"

namespace sixpoint::device {
namespace {

using tests::Bench;
using tests::Break;
using tests::breaking;
using tests::FailingFiles;
using tests::record;

// Lets the first call of `operation` break the link, then the second ..., each on an open unit of
// the same bench. `check` looks at the unit by a link of its own.
void each_call_breaks(Bench& bench, const std::function<Status(Unit&)>& operation,
                      const std::function<void(Unit&, bool complete)>& check) {
  for (std::size_t call = 0;; ++call) {
    SCOPED_TRACE("call " + std::to_string(call));
    const auto broken = std::make_shared<Break>();
    auto unit = *WireUnit::open(breaking(bench.link(), broken));
    broken->left = call;
    const Status result = operation(*unit);
    if (!result) {
      ASSERT_TRUE(broken->happened) << result.error().brief();
      EXPECT_EQ(result.error().code, ErrorCode::device_unavailable) << result.error().brief();
    }
    broken->left.reset();
    auto again = *WireUnit::open(bench.link());
    check(*again, result.has_value());
    if (!broken->happened) {
      EXPECT_OK(result);
      EXPECT_GT(call, 0U);
      return;
    }
  }
}

void nothing_to_see(Unit& /*unit*/, bool /*complete*/) {}

TEST(FailingLink, OpeningSaysThatTheUnitIsGone) {
  Bench bench;
  for (std::size_t call = 0;; ++call) {
    const auto broken = std::make_shared<Break>(Break{call});
    const auto unit = WireUnit::open(breaking(bench.link(), broken));
    if (unit) {
      EXPECT_FALSE(broken->happened);
      EXPECT_GT(call, 1U);
      return;
    }
    EXPECT_EQ(unit.error().code, ErrorCode::device_unavailable);
  }
}

// Oracle: wire_unit.h: a request whose transfer failed is repeated, and what failed is counted.
TEST(FailingLink, ATransferThatFailedOnceIsRepeated) {
  Bench bench;
  const CalibrationPage stored = *(*WireUnit::open(bench.link()))->read_calibration();
  for (std::size_t call = 0;; ++call) {
    SCOPED_TRACE("call " + std::to_string(call));
    const auto broken = std::make_shared<Break>(Break{call, ErrorCode::io});
    const auto unit = WireUnit::open(breaking(bench.link(), broken));
    ASSERT_OK(unit);
    EXPECT_EQ(*(*unit)->read_calibration(), stored);
    EXPECT_EQ((*unit)->stream_statistics().failed_transfers, broken->happened ? 1U : 0U);
    if (!broken->happened) {
      EXPECT_GT(call, 20U) << "eleven chunks of a page, written and read";
      break;
    }
  }
}

TEST(FailingLink, QuestionsAreAnsweredOrRefused) {
  Bench bench;
  const CalibrationPage stored = *(*WireUnit::open(bench.link()))->read_calibration();
  each_call_breaks(
      bench,
      [&](Unit& unit) -> Status {
        SIXPOINT_CHECK(unit.identify());
        SIXPOINT_ASSIGN(const CalibrationPage page, unit.read_calibration());
        EXPECT_EQ(page, stored);
        SIXPOINT_CHECK(unit.filter());
        SIXPOINT_CHECK(unit.recordings());
        return {};
      },
      nothing_to_see);
}

TEST(FailingLink, ConstantsAreTheOldOnesOrTheNewOnes) {
  Bench bench;
  CalibrationPage old = *(*WireUnit::open(bench.link()))->read_calibration();
  CalibrationPage fresh = old;
  int written = 0;
  each_call_breaks(
      bench,
      [&](Unit& unit) {
        fresh.calibrated = from_unix_seconds(1'600'000'000 + ++written);
        return unit.write_calibration(fresh);
      },
      [&](Unit& unit, bool complete) {
        const CalibrationPage now = *unit.read_calibration();
        EXPECT_TRUE(now == fresh || (!complete && now == old));
        old = now;
      });
  EXPECT_EQ(old, fresh);
}

TEST(FailingLink, TheFilterIsTheOldOneOrTheNewOne) {
  Bench bench;
  bool to_legacy = false;
  const auto wanted = [&] {
    return to_legacy ? FilterConfiguration::legacy : FilterConfiguration::current;
  };
  each_call_breaks(
      bench,
      [&](Unit& unit) {
        to_legacy = !to_legacy;
        return unit.set_filter(wanted());
      },
      [&](Unit& unit, bool complete) {
        if (complete) {
          EXPECT_EQ(unit.filter()->stream, wanted());
        }
      });
}

TEST(FailingLink, StreamsAndRecordingsBeginAgain) {
  Bench bench;
  each_call_breaks(
      bench,
      [](Unit& unit) -> Status {
        SIXPOINT_CHECK(unit.start_stream(100));
        for (int block = 0; block < 3; ++block) {
          SIXPOINT_CHECK(unit.next_samples(std::chrono::seconds(1)));
        }
        return unit.stop_stream();
      },
      [](Unit& unit, bool) {
        EXPECT_OK(unit.start_stream(100));
        const auto block = unit.next_samples(std::chrono::seconds(1));
        EXPECT_TRUE(block.has_value() && block->has_value());
        EXPECT_OK(unit.stop_stream());
      });
  each_call_breaks(
      bench,
      [&](Unit& unit) -> Status {
        SIXPOINT_CHECK(unit.start_recording(100, from_unix_seconds(1'500'000'000)));
        bench.clock->sleep(std::chrono::seconds(2));
        SIXPOINT_CHECK(unit.stop_recording());
        return {};
      },
      [](Unit& unit, bool) { static_cast<void>(unit.stop_recording()); });
}

TEST(FailingLink, ADownloadIsWholeOrGoesOn) {
  Bench bench;
  const RecordingInfo info = record(bench, **WireUnit::open(bench.link()), 20);
  MemoryEnv env;
  each_call_breaks(
      bench, [&](Unit& unit) { return unit.download(info, env.files, "x.gt3x"); },
      [&](Unit& unit, bool complete) {
        EXPECT_EQ(env.files.info("x.gt3x").has_value(), complete);
        if (!complete) {
          EXPECT_OK(unit.download(info, env.files, "x.gt3x"));
        }
        EXPECT_EQ(sha256(*read_file(env.files, "x.gt3x")), info.sha256);
        EXPECT_EQ(env.files.list(".")->size(), 1U);
        EXPECT_OK(env.files.remove("x.gt3x"));
      });
}

// The same where it is not the link that fails, but the disk.
TEST(FailingLink, ADiskThatFailsLeavesNoWrongRecording) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  const RecordingInfo info = record(bench, *unit, 60);
  bool broken_before = false;
  for (std::size_t call = 0; !broken_before; ++call) {
    SCOPED_TRACE("call " + std::to_string(call));
    MemoryEnv env;
    // Half of it is there from an earlier download.
    const auto pull = [&](std::uint64_t at) { bench.plugged->unplugged = at > info.bytes / 2; };
    EXPECT_FAILS(unit->download(info, env.files, "x.gt3x", pull), ErrorCode::device_unavailable);
    bench.plugged->unplugged = false;
    FailingFiles files(env.files);
    files.fail_at(call);
    const Status result = unit->download(info, files, "x.gt3x", {});
    broken_before = !files.has_failed();
    files.stop_failing();
    if (!result) {
      EXPECT_EQ(result.error().code, ErrorCode::io) << result.error().brief();
    }
    if (!env.files.info("x.gt3x")) {
      EXPECT_FALSE(result.has_value());
      ASSERT_OK(unit->download(info, files, "x.gt3x", {}));
    }
    EXPECT_EQ(sha256(*read_file(env.files, "x.gt3x")), info.sha256);
  }
}

}  // namespace
}  // namespace sixpoint::device
