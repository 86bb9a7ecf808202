// Fault plans on a unit behind the real hidapi and libusb: of the table in docs/faults.md what a
// unit of the station does, seen at its interface (device/unit.h).
#include <array>
#include <future>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "base/sha256.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "temporary_folder.h"
#include "usb/bodies.h"
#include "usb/plugged.h"

namespace sixpoint::tests {
namespace {

using device::kSamplesPerReport;
using device::Unit;
using std::chrono::milliseconds;
using std::chrono::seconds;

BenchUnit faulty_unit(std::uint64_t seed, const std::string& faults) {
  auto plan =
      mocks::parse_fault_plan(R"({"schema": "sixpoint/faults/1", "faults": [)" + faults + "]}");
  EXPECT_OK(plan);
  return make_unit(seed, std::move(plan).value_or(mocks::FaultPlan{}));
}

// An emulated processor packs a recording in a second or two.
device::WireOptions patient() {
  device::WireOptions options;
  options.reply_time_out = seconds(2);
  return options;
}

void expect_whole_download(BenchUnit& bench_unit, Unit& unit) {
  const auto info = record(bench_unit, unit, std::chrono::minutes(5));
  ASSERT_OK(info);
  const TemporaryFolder folder;
  const Status done = unit.download(*info, posix_env().files, folder / "all.gt3x");
  ASSERT_OK(done);
  EXPECT_EQ(sha256(*read_file(posix_env().files, folder / "all.gt3x")), info->sha256);
}

// Reads the stream up to sample `end`. Whatever is on the cable: in order, once, at rest, and what
// is missing is counted.
void expect_stream(Unit& unit, std::uint32_t end, const sim::UnitTruth& truth) {
  std::uint32_t next = 0;
  std::uint64_t missing = 0;
  while (next < end) {
    const auto block = unit.next_samples(seconds(5));
    ASSERT_OK(block);
    ASSERT_TRUE(block->has_value()) << "silence after sample " << next;
    ASSERT_GE((*block)->first_index, next) << "a sample came twice";
    missing += (*block)->first_index - next;
    next = (*block)->first_index + static_cast<std::uint32_t>((*block)->counts.size());
    for (const auto& counts : (*block)->counts) {
      // Oracle: closed form, z up. 40 LSB are 0.16 g: noise is 5.5 mg, what is damaged is anywhere.
      const auto& sensor = truth.current;
      EXPECT_NEAR(counts[2], sensor.zero_lsb[2] + sensor.sensitivity_lsb_per_g[2], 40);
      EXPECT_NEAR(counts[0], sensor.zero_lsb[0], 40);
    }
  }
  EXPECT_EQ(unit.stream_statistics().lost_samples, missing);
}

sim::UnitTruth truth_of(BenchUnit& unit) {
  const std::lock_guard lock(unit.unit->mutex);
  return unit.unit->unit.truth();
}

// Opens the unit, starts its stream with the current filter and reads up to sample `end`.
std::unique_ptr<Unit> streamed(Plugged& plugged, std::uint32_t end) {
  auto unit = open(plugged->hid_address());
  EXPECT_OK(unit);
  if (!unit) {
    return nullptr;
  }
  EXPECT_OK((*unit)->set_filter(device::FilterConfiguration::current));
  EXPECT_OK((*unit)->start_stream(100));
  expect_stream(**unit, end, truth_of(*plugged));
  return std::move(*unit);
}

// The cable or the hub: sees the unit leave by its plan, and it comes back into the same port.
std::future<Status> bring_back(UsbBench& bench, BenchUnit& unit) {
  return std::async(std::launch::async, [&bench, &unit]() -> Status {
    const std::string port = unit.port;
    if (!bench.wait_until_left(unit)) {
      return fail(ErrorCode::internal, "the unit did not leave the bus");
    }
    return bench.plug_in(unit, port);
  });
}

// What a reader gets while the unit goes away.
Result<std::optional<device::SampleBlock>> read_until_failure(Unit& unit) {
  Result<std::optional<device::SampleBlock>> block = std::nullopt;
  for (int i = 0; i < 200 && block; ++i) {
    block = unit.next_samples(seconds(1));
  }
  return block;
}

void a_lost_reply_is_asked_for_again(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(21, R"({"fault": "lost", "of": "replies", "at_report": 2},
                                     {"fault": "lost", "direction": "to_unit", "at_report": 5})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);
  for (int i = 0; i < 4; ++i) {
    EXPECT_OK((*unit)->filter());
  }
}

void damaged_and_short_blocks_are_downloaded_again(UsbBench& bench) {
  Plugged plugged(bench,
                  faulty_unit(22, R"({"fault": "bit_flip", "channel": "bulk", "at_report": 2},
             {"fault": "short_packet", "channel": "bulk", "at_report": 5, "bytes": 100})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->usb_address(), patient());
  ASSERT_OK(unit);
  expect_whole_download(*plugged, **unit);
}

// The kernel's own HID driver and usbfs see the stalls.
void stalled_endpoints_are_cleared_and_read_on(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(23, R"({"fault": "stall", "at_report": 3},
                                     {"fault": "stall", "channel": "bulk", "at_report": 2})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->usb_address(), patient());
  ASSERT_OK(unit);
  expect_whole_download(*plugged, **unit);
}

void unplugged_in_flight_and_back(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(24, R"({"fault": "unplug", "of": "samples", "at_report": 5,
                                             "seconds": 1})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);
  ASSERT_OK((*unit)->start_stream(100));
  auto back = bring_back(bench, *plugged);
  EXPECT_FAILS(read_until_failure(**unit), ErrorCode::device_unavailable);
  EXPECT_OK((*unit)->reconnect(seconds(20)));
  ASSERT_OK(back.get());
  EXPECT_EQ((*unit)->identity().serial, plugged->serial);
  EXPECT_OK((*unit)->start_stream(100));
  expect_stream(**unit, 30, truth_of(*plugged));
}

void a_swapped_unit_is_known_by_its_serial_number(UsbBench& bench) {
  // Opened as whichever there is, and by its serial number: then the other one is not even opened.
  for (const bool by_serial : {false, true}) {
    Plugged plugged(bench, faulty_unit(25, R"({"fault": "swap", "of": "samples", "at_report": 4,
                                               "serial": "MOS2B99990009"})"));
    ASSERT_OK(plugged.status());
    auto unit = open(by_serial ? plugged->hid_address() : "hid:");
    ASSERT_OK(unit);
    ASSERT_OK((*unit)->start_stream(100));
    auto back = bring_back(bench, *plugged);
    EXPECT_FAILS(read_until_failure(**unit), ErrorCode::device_unavailable);
    ASSERT_OK(back.get());
    const Status again = (*unit)->reconnect(seconds(2));
    EXPECT_FAILS(again, ErrorCode::device_unavailable);
    for (const std::string& named : {plugged->serial, std::string("MOS2B99990009")}) {
      EXPECT_NE((again.error().what + again.error().hint).find(named), std::string::npos)
          << again.error().brief();
    }
    unit->reset();
    EXPECT_FAILS(registry().open(plugged->hid_address(), posix_env()),
                 ErrorCode::device_unavailable);
    auto other = open("hid:MOS2B99990009");
    ASSERT_OK(other);
    EXPECT_EQ((*other)->identity().serial, "MOS2B99990009");
  }
}

void a_late_reply_is_asked_for_again_and_dropped(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(26, R"({"fault": "delay", "of": "replies", "at_report": 3,
                                             "seconds": 0.7})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);
  const auto before = (*unit)->filter();
  ASSERT_OK(before);
  // Of the repeats each is answered: those replies come while the next is asked.
  EXPECT_EQ((*unit)->identify()->serial, plugged->serial);
  const auto after = (*unit)->filter();
  ASSERT_OK(after);
  EXPECT_EQ(after->stream, before->stream);
  EXPECT_EQ((*unit)->stream_statistics().damaged_reports, 0U);
}

void a_reply_that_never_comes_is_a_unit_that_does_not_answer(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(27, R"({"fault": "delay", "of": "replies", "at_report": 2,
                                             "seconds": 2})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address(), {});
  ASSERT_OK(unit);
  const auto filter = (*unit)->filter();
  EXPECT_FAILS(filter, ErrorCode::device_unavailable);
  EXPECT_NE(filter.error().what.find("does not answer"), std::string::npos)
      << filter.error().brief();
}

void damaged_reports_are_dropped_and_counted(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(28, R"({"fault": "bad_crc", "of": "samples", "at_report": 3},
                                {"fault": "garbage", "of": "samples", "at_report": 6},
                                {"fault": "bit_flip", "of": "samples", "at_report": 9, "bit": 6},
                                {"fault": "bad_crc", "of": "replies", "at_report": 2})"));
  ASSERT_OK(plugged.status());
  const auto unit = streamed(plugged, 15 * kSamplesPerReport);
  ASSERT_TRUE(unit);
  EXPECT_EQ(unit->stream_statistics().lost_samples, 3 * kSamplesPerReport);
  EXPECT_EQ(unit->stream_statistics().damaged_reports, 3U);
  EXPECT_OK(unit->stop_stream());
}

void duplicate_reports_are_delivered_once(UsbBench& bench) {
  Plugged plugged(
      bench, faulty_unit(29, R"({"fault": "duplicate", "of": "samples", "at_report": 2, "every": 2},
                         {"fault": "duplicate", "of": "replies", "at_report": 1, "every": 2})"));
  ASSERT_OK(plugged.status());
  const auto unit = streamed(plugged, 12 * kSamplesPerReport);
  ASSERT_TRUE(unit);
  EXPECT_EQ(unit->stream_statistics().lost_samples, 0U);
  EXPECT_GE(unit->stream_statistics().duplicate_reports, 5U);
  EXPECT_OK(unit->stop_stream());
}

void another_sequence_is_never_taken_for_the_right_one(UsbBench& bench) {
  Plugged plugged(bench,
                  faulty_unit(30, R"({"fault": "wrong_sequence", "of": "samples", "at_report": 4},
                         {"fault": "wrong_sequence", "of": "replies", "at_report": 2})"));
  ASSERT_OK(plugged.status());
  const auto unit = streamed(plugged, 10 * kSamplesPerReport);
  ASSERT_TRUE(unit);
  EXPECT_EQ(unit->stream_statistics().lost_samples, kSamplesPerReport);
  EXPECT_EQ(unit->stream_statistics().damaged_reports, 1U);
  EXPECT_OK(unit->stop_stream());
}

void a_unit_that_started_anew_streams_again(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(31, R"({"fault": "reset", "of": "samples", "at_report": 6})"));
  ASSERT_OK(plugged.status());
  auto unit = streamed(plugged, 4 * kSamplesPerReport);
  ASSERT_TRUE(unit);
  bool silent = false;
  for (int i = 0; i < 10 && !silent; ++i) {
    const auto block = unit->next_samples(seconds(1));
    ASSERT_OK(block);
    silent = !block->has_value();
  }
  ASSERT_TRUE(silent) << "its RAM is lost and the stream with it";
  ASSERT_OK(unit->reconnect(seconds(10)));
  EXPECT_EQ(unit->identity().serial, plugged->serial);
  ASSERT_OK(unit->set_filter(device::FilterConfiguration::current));
  ASSERT_OK(unit->start_stream(100));
  expect_stream(*unit, 5 * kSamplesPerReport, truth_of(*plugged));
  EXPECT_EQ(unit->stream_statistics().lost_samples, 0U);
}

void a_unit_at_another_node_is_found_again(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(32, R"({"fault": "reenumerate", "of": "samples",
                                             "at_report": 6})"));
  ASSERT_OK(plugged.status());
  auto unit = streamed(plugged, 2 * kSamplesPerReport);
  ASSERT_TRUE(unit);
  auto back = bring_back(bench, *plugged);
  EXPECT_FAILS(read_until_failure(*unit), ErrorCode::device_unavailable);
  EXPECT_OK(unit->reconnect(seconds(20)));
  ASSERT_OK(back.get());
  ASSERT_OK(unit->start_stream(100));
  expect_stream(*unit, 5 * kSamplesPerReport, truth_of(*plugged));
}

constexpr StoredConstants kOtherConstants = {{300, 301, 302}, {-200, -201, -202}, {50, 51, 52}};

void an_unreadable_page_is_refused_and_replaced(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(33, R"({"fault": "bad_page", "at_s": 0})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);
  EXPECT_FAILS((*unit)->read_calibration(), ErrorCode::bad_data);
  const device::CalibrationPage page{kOtherConstants, from_unix_seconds(1'600'000'000)};
  ASSERT_OK((*unit)->write_calibration(page));
  EXPECT_EQ(*(*unit)->read_calibration(), page);
}

void a_low_battery_keeps_the_old_constants(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(34, R"({"fault": "battery_low", "at_s": 0})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);
  const auto before = (*unit)->read_calibration();
  ASSERT_OK(before);
  const Status written =
      (*unit)->write_calibration({kOtherConstants, from_unix_seconds(1'600'000'000)});
  EXPECT_FAILS(written, ErrorCode::io);
  EXPECT_EQ(written.error().hint, "charge the unit");
  EXPECT_EQ(*(*unit)->read_calibration(), *before);
  EXPECT_EQ(before->constants, truth_of(*plugged).constants);
}

void a_full_flash_refuses_to_record(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(35, R"({"fault": "full_flash", "at_s": 0})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->usb_address());
  ASSERT_OK(unit);
  const auto recording = (*unit)->start_recording(100, from_unix_seconds(1'500'000'000));
  EXPECT_FAILS(recording, ErrorCode::io);
  EXPECT_NE(recording.error().what.find("storage full"), std::string::npos)
      << recording.error().brief();
  EXPECT_TRUE((*unit)->recordings()->empty());
  EXPECT_OK((*unit)->start_stream(100)) << "a jig run needs none";
}

void a_jumping_clock_is_noted_and_nothing_is_lost(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(36, R"({"fault": "clock_jump", "of": "samples",
                                             "at_report": 5, "seconds": -5})"));
  ASSERT_OK(plugged.status());
  plugged->clock->forward(seconds(60));  // device time begins at 0 and stops there
  const auto unit = streamed(plugged, 12 * kSamplesPerReport);
  ASSERT_TRUE(unit);
  EXPECT_EQ(unit->stream_statistics().clock_jumps, 1U);
  EXPECT_NEAR(unit->stream_statistics().clock_jumped_s, -5, 0.05);
  EXPECT_EQ(unit->stream_statistics().lost_samples, 0U);
}

void a_frozen_sensor_repeats_its_counts(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(37, R"({"fault": "frozen_sensor", "at_s": 0})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);
  ASSERT_OK((*unit)->start_stream(100));
  const auto first = (*unit)->next_samples(seconds(5));
  ASSERT_OK(first);
  ASSERT_TRUE(first->has_value());
  for (int i = 0; i < 5; ++i) {
    const auto block = (*unit)->next_samples(seconds(5));
    ASSERT_OK(block);
    ASSERT_TRUE(block->has_value());
    for (const auto& counts : (*block)->counts) {
      EXPECT_EQ(counts, (*first)->counts.front());
    }
  }
}

void a_stuck_axis_repeats_alone(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(39, R"({"fault": "axis_stuck", "at_s": 0, "axis": "y"})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);
  ASSERT_OK((*unit)->start_stream(100));
  std::array<std::set<std::int16_t>, kAxes> seen;
  for (int i = 0; i < 15; ++i) {
    const auto block = (*unit)->next_samples(seconds(5));
    ASSERT_OK(block);
    ASSERT_TRUE(block->has_value());
    for (const auto& counts : (*block)->counts) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        seen[axis].insert(counts[axis]);
      }
    }
  }
  EXPECT_EQ(seen[1].size(), 1U);
  EXPECT_GT(seen[0].size(), 1U) << "5.5 mg of noise";
  EXPECT_GT(seen[2].size(), 1U);
}

void power_lost_in_a_write_leaves_a_whole_page(UsbBench& bench) {
  Plugged plugged(bench, faulty_unit(38, R"({"fault": "power_loss", "at_s": 0, "bytes": 300,
                                             "seconds": 0.5})"));
  ASSERT_OK(plugged.status());
  auto unit = open(plugged->hid_address());
  ASSERT_OK(unit);
  const auto before = (*unit)->read_calibration();
  ASSERT_OK(before);
  const device::CalibrationPage page{kOtherConstants, from_unix_seconds(1'600'000'000)};
  auto back = bring_back(bench, *plugged);
  EXPECT_FAILS((*unit)->write_calibration(page), ErrorCode::device_unavailable);
  ASSERT_OK((*unit)->reconnect(seconds(20)));
  ASSERT_OK(back.get());
  EXPECT_EQ(*(*unit)->read_calibration(), *before) << "neither half of the new one is in force";
  ASSERT_OK((*unit)->write_calibration(page));
  EXPECT_EQ(*(*unit)->read_calibration(), page);
}

}  // namespace

const std::vector<UsbBody>& usb_fault_bodies() {
  static const std::vector<UsbBody> kBodies = {
      {"ALostReplyIsAskedForAgain", a_lost_reply_is_asked_for_again},
      {"DamagedAndShortBlocksAreDownloadedAgain", damaged_and_short_blocks_are_downloaded_again},
      {"StalledEndpointsAreClearedAndReadOn", stalled_endpoints_are_cleared_and_read_on},
      {"UnpluggedInFlightAndBack", unplugged_in_flight_and_back},
      {"ASwappedUnitIsKnownByItsSerialNumber", a_swapped_unit_is_known_by_its_serial_number},
      {"ALateReplyIsAskedForAgainAndDropped", a_late_reply_is_asked_for_again_and_dropped},
      {"AReplyThatNeverComesIsAUnitThatDoesNotAnswer",
       a_reply_that_never_comes_is_a_unit_that_does_not_answer},
      {"DamagedReportsAreDroppedAndCounted", damaged_reports_are_dropped_and_counted},
      {"DuplicateReportsAreDeliveredOnce", duplicate_reports_are_delivered_once},
      {"AnotherSequenceIsNeverTakenForTheRightOne",
       another_sequence_is_never_taken_for_the_right_one},
      {"AUnitThatStartedAnewStreamsAgain", a_unit_that_started_anew_streams_again},
      {"AUnitAtAnotherNodeIsFoundAgain", a_unit_at_another_node_is_found_again},
      {"AnUnreadablePageIsRefusedAndReplaced", an_unreadable_page_is_refused_and_replaced},
      {"ALowBatteryKeepsTheOldConstants", a_low_battery_keeps_the_old_constants},
      {"AFullFlashRefusesToRecord", a_full_flash_refuses_to_record},
      {"AJumpingClockIsNotedAndNothingIsLost", a_jumping_clock_is_noted_and_nothing_is_lost},
      {"AFrozenSensorRepeatsItsCounts", a_frozen_sensor_repeats_its_counts},
      {"AStuckAxisRepeatsAlone", a_stuck_axis_repeats_alone},
      {"PowerLostInAWriteLeavesAWholePage", power_lost_in_a_write_leaves_a_whole_page},
  };
  return kBodies;
}

}  // namespace sixpoint::tests
