// Fault plans where the kernel is real: what it makes of them, and that the station comes through.
#include <fstream>

#include <gtest/gtest.h>

#include "base/sha256.h"
#include "device/discovery.h"
#include "device/unit.h"
#include "expect_result.h"
#include "system/vhci_bench.h"
#include "temporary_folder.h"

namespace sixpoint::tests {
namespace {

using std::chrono::seconds;

BenchUnit faulty_unit(std::uint64_t seed, const std::string& faults) {
  auto plan =
      mocks::parse_fault_plan(R"({"schema": "sixpoint/faults/1", "faults": [)" + faults + "]}");
  EXPECT_TRUE(plan.has_value()) << plan.error().brief();
  mocks::VirtualUnitOptions options;
  options.truth = sim::draw_unit(seed);
  options.seed = seed;
  BenchUnit unit;
  unit.serial = options.truth.serial;
  unit.clock = std::make_shared<LeapingClock>();
  unit.unit =
      std::make_shared<mocks::PluggedUnit>(std::move(options), *std::move(plan), unit.clock);
  unit.device = std::make_shared<mocks::UsbUnit>(unit.unit);
  return unit;
}

Result<std::unique_ptr<device::Unit>> open(const std::string& address) {
  device::TransportRegistry registry;
  device::register_usb(registry);
  // The emulated processor packs a recording in a second or two.
  device::UnitOptions patient;
  patient.reply_time_out = seconds(2);
  for (int i = 0;; ++i) {
    auto link = registry.open(address, posix_env());
    if (link) {
      return device::Unit::open(std::move(*link), patient);
    }
    if (link.error().code != ErrorCode::device_unavailable || i == 1000) {
      return fail(link.error());
    }
    posix_env().clock.sleep(std::chrono::milliseconds(10));
  }
}

Result<device::RecordingInfo> record(BenchUnit& bench_unit, device::Unit& unit) {
  SIXPOINT_CHECK(unit.start_recording(100, from_unix_seconds(1'500'000'000)));
  bench_unit.clock->forward(std::chrono::minutes(5));
  SIXPOINT_CHECK(unit.stop_recording());
  SIXPOINT_ASSIGN(const auto list, unit.recordings());
  return list.back();
}

TEST(Faults, ALostReplyIsAskedForAgain) {
  VhciBench bench;
  auto bench_unit = faulty_unit(21, R"({"fault": "lost", "of": "replies", "at_report": 2},
             {"fault": "lost", "direction": "to_unit", "at_report": 5})");
  ASSERT_OK(bench.plug_in(bench_unit));
  auto unit = open(bench_unit.hid_address());
  ASSERT_OK(unit);
  for (int i = 0; i < 4; ++i) {
    EXPECT_OK((*unit)->filter());
  }
}

TEST(Faults, DamagedAndShortBlocksAreDownloadedAgain) {
  VhciBench bench;
  auto bench_unit = faulty_unit(22, R"({"fault": "bit_flip", "channel": "bulk", "at_report": 2},
             {"fault": "short_packet", "channel": "bulk", "at_report": 5, "bytes": 100})");
  ASSERT_OK(bench.plug_in(bench_unit));
  auto unit = open(bench_unit.usb_address());
  ASSERT_OK(unit);
  const auto info = record(bench_unit, **unit);
  ASSERT_OK(info);
  const TemporaryFolder folder;
  const Status done = (*unit)->download(*info, posix_env().files, folder / "all.gt3x");
  ASSERT_OK(done);
  EXPECT_EQ(sha256(*read_file(posix_env().files, folder / "all.gt3x")), info->sha256);
}

// The kernel's own HID driver and usbfs see the stalls.
TEST(Faults, StalledEndpointsAreClearedAndReadOn) {
  VhciBench bench;
  auto bench_unit = faulty_unit(23, R"({"fault": "stall", "at_report": 3},
                                       {"fault": "stall", "channel": "bulk", "at_report": 2})");
  ASSERT_OK(bench.plug_in(bench_unit));
  auto unit = open(bench_unit.usb_address());
  ASSERT_OK(unit);
  const auto info = record(bench_unit, **unit);
  ASSERT_OK(info);
  const TemporaryFolder folder;
  const Status done = (*unit)->download(*info, posix_env().files, folder / "all.gt3x");
  ASSERT_OK(done);
  EXPECT_EQ(sha256(*read_file(posix_env().files, folder / "all.gt3x")), info->sha256);
}

TEST(Faults, UnpluggedInFlightAndBack) {
  VhciBench bench;
  auto bench_unit =
      faulty_unit(24, R"({"fault": "unplug", "of": "samples", "at_report": 5, "seconds": 1})");
  ASSERT_OK(bench.plug_in(bench_unit));
  const std::string port = bench_unit.port;
  auto unit = open(bench_unit.hid_address());
  ASSERT_OK(unit);
  ASSERT_OK((*unit)->start_stream(100));
  Result<std::optional<device::SampleBlock>> block = std::nullopt;
  for (int i = 0; i < 100 && block; ++i) {
    block = (*unit)->next_samples(seconds(1));
  }
  EXPECT_FAILS(block, ErrorCode::device_unavailable);
  ASSERT_TRUE(wait_for_path("/sys/bus/usb/devices/" + port, false)) << "the kernel saw it leave";
  unit->reset();
  ASSERT_OK(bench.plug_in(bench_unit, port));
  unit = open(bench_unit.hid_address());
  ASSERT_OK(unit);
  EXPECT_EQ((*unit)->identity().serial, bench_unit.serial);
}

TEST(Faults, ASwappedUnitIsKnownByItsSerialNumber) {
  VhciBench bench;
  auto bench_unit =
      faulty_unit(25, R"({"fault": "swap", "at_report": 4, "serial": "MOS2B99990009"})");
  ASSERT_OK(bench.plug_in(bench_unit));
  const std::string port = bench_unit.port;
  {
    auto unit = open(bench_unit.hid_address());
    ASSERT_OK(unit);
    Status status;
    for (int i = 0; i < 10 && status; ++i) {
      if (auto filter = (*unit)->filter(); !filter) {
        status = fail(filter.error());
      }
    }
    EXPECT_FAILS(status, ErrorCode::device_unavailable);
  }
  ASSERT_TRUE(wait_for_path("/sys/bus/usb/devices/" + port, false));
  ASSERT_OK(bench.plug_in(bench_unit, port));
  auto other = open("hid:MOS2B99990009");
  ASSERT_OK(other);
  EXPECT_EQ((*other)->identity().serial, "MOS2B99990009");
  std::ifstream serial("/sys/bus/usb/devices/" + port + "/serial");
  std::string text;
  std::getline(serial, text);
  EXPECT_EQ(text, "MOS2B99990009");
}

}  // namespace
}  // namespace sixpoint::tests
